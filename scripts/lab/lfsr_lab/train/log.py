"""Training log: one JSON line per epoch, and its curves as an image."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from lfsr_core.base.files import atomic_path, system_errors
from lfsr_lab.train.reading import open_data

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
        """Append one epoch."""
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
