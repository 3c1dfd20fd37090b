"""Times: of the second stage, of rivals that take turns, and of processors."""

from __future__ import annotations

import dataclasses
import os
import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from lfsr_core.base.messages import LfsrError
from lfsr_core.commands.sentences import sentence
from lfsr_core.frames.frame import FRAME_FILE, LOW_RES_FILE, WORLD_FILE, read_frame
from lfsr_core.reconstruct.second_stage import finish_frame
from lfsr_lab.experiments.engine.report import load_average
from lfsr_lab.networks.methods import ready

STAGES = ("load", "mask", "upscale", "assemble", "color", "write")
Seconds = dict[str, tuple[float, ...]]
"""Seconds of every run, by the name of what was run."""


@dataclasses.dataclass(frozen=True)
class StageTimes:
    second_stage_seconds: tuple[float, ...]  # of every run
    stage_seconds: dict[str, float]  # medians of its parts
    notes: tuple[str, ...]  # its sentences
    load_average: float | None  # of the machine, before the runs

    def __post_init__(self) -> None:
        if not self.second_stage_seconds or "upscale" not in self.stage_seconds:
            raise LfsrError("times of the second stage must be known, those of all runs and of the stage upscale: "
                            "measure them again")


def second_stage_times(folder: Path, name: str, repeats: int, warm: bool) -> StageTimes:
    """Time the second stage of a frame folder, which is written to; without ``warm`` one run first does not count."""
    finish, upscaler = ready(name)
    if not warm:
        finish_frame(folder, finish, upscaler=upscaler)
    load = load_average()
    seconds, reports = [], []
    for _ in range(repeats):
        started = time.perf_counter()
        reports.append(finish_frame(folder, finish, upscaler=upscaler))
        seconds.append(round(time.perf_counter() - started, 4))
    stages = {stage: statistics.median(report.seconds[stage] for report in reports) for stage in STAGES}
    return StageTimes(tuple(seconds), stages, tuple(map(sentence, reports[-1].notes)), load)


@contextmanager
def scratch_copy(folder: Path) -> Iterator[Path]:
    """Yield a temporary folder beside ``folder`` with the same render, so that ``folder`` stays as it is."""
    with tempfile.TemporaryDirectory(prefix=".scratch-", dir=folder.parent) as name:
        for file in (FRAME_FILE, LOW_RES_FILE, *([WORLD_FILE] if read_frame(folder).world_apart else [])):
            try:
                os.link(folder / file, Path(name) / file)
            except OSError:  # another file system, or one without links
                shutil.copyfile(folder / file, Path(name) / file)
        yield Path(name)


def take_turns(functions: Mapping[str, Callable[[], Any]], repeats: int) -> Seconds:
    """Return the seconds of every call, ``repeats`` per function in turn, after one call each that does not count.

    What else the machine does then hits all alike. A function must return only when its work is done.
    """
    for function in functions.values():
        function()
    seconds: dict[str, list[float]] = {name: [] for name in functions}
    for _ in range(repeats):
        for name, function in functions.items():
            started = time.perf_counter()
            function()
            seconds[name].append(round(time.perf_counter() - started, 6))
    return {name: tuple(times) for name, times in seconds.items()}


def median_ms(seconds: Sequence[float]) -> float:
    return 1e3 * statistics.median(seconds)


def cpu_seconds() -> float:
    """Return the processor seconds of this process so far, on all cores."""
    times = os.times()
    return times.user + times.system


def children_cpu_seconds() -> float:
    """Return the processor seconds of this process's children so far, those that still run too; for Linux."""
    times = os.times()
    seconds = times.children_user + times.children_system
    if sys.platform != "win32":
        for stat in Path("/proc").glob("[0-9]*/stat"):
            with suppress(OSError):  # it has ended
                fields = stat.read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
                if int(fields[1]) == os.getpid():
                    seconds += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return seconds
