"""The training loop: steps of a task, with a log, checkpoints, resumption and a clean stop.

A task defines a step; the loop knows no network. Losses stay on the device
until an epoch ends, so that a GPU never waits for Python.
"""

from __future__ import annotations

import hashlib
import io
import json
import signal
import time
import zipfile
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, Protocol

import torch
from torch import Tensor

from lfsr_core.base.messages import LfsrError, Progress, Tell, silent
from lfsr_core.base.records import from_data
from lfsr_core.base.system import atomic_path, reading, system_errors


@contextmanager
def open_data(path: str | Path, what: str, advice: str) -> Iterator[IO[bytes]]:
    """Open a regular file; any error inside the block becomes an LfsrError that says ``what`` was expected.

    Libraries raise what they like for damaged content, and their own advice is meant for programmers: ``advice`` stands
    in its place.
    """
    with reading(path, what) as file:
        try:
            yield file
        except Exception as error:
            reason = str(error) if isinstance(error, LfsrError) else "it is damaged, or another kind of file"
            raise LfsrError(f"{path} cannot be read as {what} ({reason}): {advice}") from error


LOG_NAME, IMAGE_NAME = "log.jsonl", "loss.png"
NO_CURVE = {"epoch", "seconds"}


class TrainLog:
    """Log of a run in ``folder``; lines after epoch ``keep_epochs`` are dropped, because a resumed run repeats them."""

    def __init__(self, folder: str | Path, keep_epochs: int = 0) -> None:
        self._path = Path(folder, LOG_NAME)
        kept = [line for line in read_log(self._path) if line["epoch"] <= keep_epochs] if self._path.exists() else []
        with atomic_path(self._path) as temporary:
            temporary.write_text("".join(json.dumps(line) + "\n" for line in kept), encoding="utf-8")
        self.lines: list[dict[str, Any]] = kept

    def add(self, line: dict[str, Any]) -> None:
        self.lines.append(line)
        with system_errors(self._path), self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")

    def last_validation(self) -> dict[str, float]:
        """Validation metrics of the latest validated epoch."""
        validated = [line for line in self.lines if any("." in key for key in line)]
        return {key: value for key, value in validated[-1].items() if "." in key} if validated else {}

    def draw(self) -> None:
        """Write loss.png: losses on a logarithmic axis; validation metrics, named "data.metric", below them."""
        from matplotlib.figure import Figure

        if not self.lines:
            return
        figure = Figure(figsize=(7, 6), layout="constrained")
        losses, figures = figure.subplots(2, 1, sharex=True)
        for name in dict.fromkeys(key for line in self.lines for key in line if key not in NO_CURVE):
            axes = figures if "." in name else losses
            points = [(line["epoch"], line[name]) for line in self.lines if name in line]
            axes.plot(*zip(*points, strict=True), marker=".", label=name)
        losses.set(ylabel="loss", yscale="log")
        figures.set(ylabel="validation", xlabel="epoch")
        for axes in (losses, figures):
            axes.grid(alpha=0.3)
            if axes.lines:
                axes.legend(fontsize="small")
        with atomic_path(self._path.with_name(IMAGE_NAME)) as temporary:
            figure.savefig(temporary, dpi=100)


def read_log(path: str | Path) -> list[dict[str, Any]]:
    """Read the lines of a log; LfsrError if one is no JSON object of an epoch and of numbers."""
    with open_data(path, "a training log", "choose another --output") as file:
        lines = [json.loads(line) for line in file.read().decode("utf-8").splitlines()]
        for line in lines:
            if type(line["epoch"]) is not int or not all(type(value) in (int, float) for value in line.values()):
                raise ValueError(f"a line with {line}")
    return lines


CHECKPOINT, CHECKPOINT_VERSION = "checkpoint.pt", 1


class Task(Protocol):
    def identity(self) -> dict[str, Any]:
        """Plain values that must be equal for a run to be resumed."""

    def begin(self, epoch: int) -> int:
        """Prepare an epoch, whose content must depend on its number alone; return its number of steps."""

    def step(self, index: int) -> dict[str, Tensor]:
        """Train on one batch; return detached scalar losses, still on the device."""

    def validate(self) -> dict[str, float]:
        """Metrics for the log."""

    def state(self) -> dict[str, Any]:
        """Everything that training changes, as tensors, numbers, strings, lists and dicts only."""

    def restore(self, state: dict[str, Any]) -> None:
        """Return to a ``state``."""


@dataclass(frozen=True)
class Schedule:
    """How long to train, and how often (in epochs) to validate and to write a checkpoint."""

    epochs: int
    validate_every: int = 10
    checkpoint_every: int = 10


@dataclass
class Position:
    epoch: int = 0  # finished epochs
    step: int = 0  # finished steps of the next epoch
    sums: dict[str, Any] = field(default_factory=dict)  # losses summed over those steps
    seconds: float = 0.0


@dataclass(frozen=True)
class Outcome:
    epochs: int
    stopped: bool  # a signal ended the run before its last epoch
    seconds: float  # over all resumed parts
    validation: dict[str, float]
    weights: Path | None = None  # file written by a finished ``session.train``


class Stop:
    """``asked`` becomes True on SIGINT or SIGTERM, or when it is set."""

    def __init__(self) -> None:
        self.asked = False

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Catch the signals inside the block; a second one interrupts at once."""
        try:
            before = {number: signal.signal(number, self._ask) for number in (signal.SIGINT, signal.SIGTERM)}
        except ValueError:  # other threads than the main one get no signals
            before = {}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _ask(self, _signal: int, _frame: object) -> None:
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True


@dataclass(frozen=True)
class RunOptions:
    """Resumption, progress and a way to stop a run."""

    resume: bool = False  # continue from the checkpoint in the output folder
    tell: Tell = silent
    stop: Stop = field(default_factory=Stop)


def run(task: Task, schedule: Schedule, output: str | Path, options: RunOptions | None = None) -> Outcome:
    """Train ``task``, writing log.jsonl, loss.png and checkpoint.pt to the folder ``output``.

    A resumed run ends as an uninterrupted one would. LfsrError if the folder holds a checkpoint of
    another run, or any checkpoint and ``options.resume`` is off.
    """
    options = options or RunOptions()
    output = Path(output)
    position = _start(task, output, options.resume)
    log = TrainLog(output, keep_epochs=position.epoch)
    with options.stop.listening():
        while position.epoch < schedule.epochs:
            started, steps = time.monotonic(), task.begin(position.epoch)
            while position.step < steps and not options.stop.asked:
                for name, loss in task.step(position.step).items():
                    position.sums[name] = position.sums.get(name, 0) + loss
                position.step += 1
                fraction = (position.epoch + position.step / steps) / schedule.epochs
                options.tell(Progress("train", fraction, f"epoch {position.epoch + 1} of {schedule.epochs}"))
            position.sums = {name: float(value) for name, value in position.sums.items()}
            position.seconds += time.monotonic() - started
            if options.stop.asked:
                break
            losses = {name: value / position.step for name, value in position.sums.items()}
            position.epoch, position.step, position.sums = position.epoch + 1, 0, {}
            last = position.epoch == schedule.epochs
            measured = task.validate() if last or position.epoch % schedule.validate_every == 0 else {}
            log.add({"epoch": position.epoch, "seconds": round(position.seconds, 3), **losses, **measured})
            if last or position.epoch % schedule.checkpoint_every == 0:
                save_checkpoint(task, output, position)
    stopped = position.epoch < schedule.epochs
    if stopped:
        save_checkpoint(task, output, position)
    log.draw()
    return Outcome(position.epoch, stopped, position.seconds, log.last_validation())


def save_checkpoint(task: Task, output: Path, position: Position) -> None:
    """Write checkpoint.pt, leaving no partial file."""
    content = {"version": CHECKPOINT_VERSION, "run": _fingerprint(task), "position": vars(position),
               "state": task.state()}
    buffer = io.BytesIO()  # PyTorch's own writer has no readable error for a full disk
    torch.save(content, buffer)
    with atomic_path(output / CHECKPOINT) as temporary:
        temporary.write_bytes(buffer.getvalue())


def load_checkpoint(path: Path) -> dict[str, Any]:
    """Read a checkpoint without running code from it; LfsrError if it is damaged or of another version."""
    with _open_checkpoint(path) as file:
        if damaged := zipfile.ZipFile(file).testzip():  # PyTorch reads over wrong checksums
            raise ValueError(f"{damaged} has another checksum")
        file.seek(0)
        content: dict[str, Any] = torch.load(file, map_location="cpu", weights_only=True)
        version = content["version"]
    if version != CHECKPOINT_VERSION:
        raise LfsrError(f"{path} has checkpoint version {version!r}, expected {CHECKPOINT_VERSION}: "
                        f"remove it and start again")
    return content


def _start(task: Task, output: Path, resume: bool) -> Position:
    path = output / CHECKPOINT
    output.mkdir(parents=True, exist_ok=True)
    if not path.exists():
        if resume:
            raise LfsrError(f"{path} does not exist, so there is nothing to resume: start without --resume")
        return Position()
    if not resume:
        raise LfsrError(f"{output} already holds a training run: pass --resume to continue or choose another --output")
    content = load_checkpoint(path)
    if content.get("run") != _fingerprint(task):
        raise LfsrError(f"{path} was written by a run with other settings or data: resume with the same ones or "
                        f"choose another --output")
    with _open_checkpoint(path):
        position = from_data(Position, content["position"], "position")
        if min(position.epoch, position.step) < 0:
            raise ValueError(f"a run at epoch {position.epoch}, step {position.step}")
        task.restore(content["state"])
    return position


def _open_checkpoint(path: Path) -> AbstractContextManager[IO[bytes]]:
    return open_data(path, "a checkpoint", "remove it and start again")


def _fingerprint(task: Task) -> str:
    return hashlib.sha256(json.dumps(task.identity(), sort_keys=True).encode()).hexdigest()
