"""What the stability suite keeps as JSON: its settings, one record per cell, and the report in stress.json."""

from __future__ import annotations

import dataclasses
from typing import Any

from lfsr_core.bench.stress.dials import Break, label
from lfsr_core.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile

FORMAT = 1
MARKS = {"below bicubic": "b", "below its start": "s"}
# Figures of some dials beside the judged one.
EXTRAS = {"border": ("rmse_border", "rmse_centre", "border_ratio", "ssim_centre"),
          "motion": ("flicker_fixed", "flicker_changing", "ssim_eia_fg"),
          "eye": ("neighbour_error", "ssim_eia_fg"), "recall": ("ssim_eia_fg",), "wire": ("recall",), "share": ("p",)}


@dataclasses.dataclass(frozen=True)
class Settings:
    """What decides every figure of a bench folder besides the dials and methods.

    Attributes
    ----------
    display: that all scenes are made for.
    scale: of the low-resolution renders, at least 2.
    reference_samples: per pixel, of both halves of a reference together.
    frames: of the moving card.
    device: Cycles device.
    format: of the files.
    """

    display: DisplayProfile
    scale: int
    reference_samples: int
    frames: int
    device: str = "CPU"
    format: int = FORMAT

    def __post_init__(self) -> None:
        self.display.low_views(self.scale)
        if self.scale < 2:
            raise LfsrError(f"scale is {self.scale}, but the suite compares upscaling methods: choose 2 or more")
        if self.reference_samples < 2 or self.frames < 2:
            raise LfsrError(f"a reference has {self.reference_samples} samples and the motion {self.frames} frames, "
                            "but both need at least 2")

    def __str__(self) -> str:
        (sx, sy), (px, py) = self.display.lenses, self.display.views
        return (f"Display {self.display.name}, {sx}×{sy} lenses of {px}×{py} views, s = {self.scale}; references of "
                f"{self.reference_samples} samples in two halves; 16 samples per pixel unless the dial says "
                f"otherwise; {self.frames} frames of motion.")


@dataclasses.dataclass(frozen=True)
class Cell:
    """The figures of one method at one value of one dial.

    Attributes
    ----------
    value: of the dial.
    scene: folder of the scene.
    samples: per pixel of the low-resolution render.
    method: its name.
    metrics: figures by name, None where one could not be measured.
    worst_lens: (row, column) of the foreground lens with the largest error, None without foreground.
    weights: SHA-256 over the files of the method's weights, empty without.
    versions: of the method's parts that have one, by name.
    """

    value: float
    scene: str
    samples: int
    method: str
    metrics: dict[str, float | None]
    worst_lens: tuple[int, int] | None
    weights: str = ""
    versions: dict[str, int] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class DialReport:
    """What was measured along one dial.

    Attributes
    ----------
    name, meaning, unit, judged: as of the dial.
    values: that were measured, from easy to hard.
    cells: one per value and method.
    breaks: where each method breaks, None where it never does.
    """

    name: str
    meaning: str
    unit: str
    judged: str
    values: tuple[float, ...]
    cells: tuple[Cell, ...]
    breaks: dict[str, Break | None]

    @property
    def span(self) -> str:
        """First and last value."""
        return f"{label(self.values[0])} – {label(self.values[-1])}"

    @property
    def shown(self) -> tuple[str, ...]:
        """Metrics that deserve a table, the judged one first."""
        return (self.judged, *EXTRAS.get(self.name, ()))

    def series(self, method: str, metric: str) -> list[float | None]:
        """One metric of one method along the dial."""
        by_value = {cell.value: cell.metrics.get(metric) for cell in self.cells if cell.method == method}
        return [by_value[value] for value in self.values]

    def break_text(self, method: str) -> str:
        """How a table shows where ``method`` breaks."""
        if all(value is None for value in self.series(method, self.judged)):
            return "?"
        found = self.breaks[method]
        return "–" if found is None else f"{label(found.value)} {MARKS[found.reason]}"


@dataclasses.dataclass(frozen=True)
class Report:
    """Everything that was measured in a bench folder.

    Attributes
    ----------
    format: of the file.
    settings: of the bench folder.
    environment: of the machine that wrote the report.
    methods: their names, bicubic first.
    dials: one entry per dial.
    """

    format: int
    settings: Settings
    environment: dict[str, Any]
    methods: tuple[str, ...]
    dials: tuple[DialReport, ...]
