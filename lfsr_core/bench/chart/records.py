"""What chart.json holds, as records; see docs/reference/chart.md."""

from __future__ import annotations

import dataclasses
import statistics
from pathlib import Path
from typing import Literal

from lfsr_core.bench.environment import Environment
from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json
from lfsr_core.records import from_data

FORMAT = 1
LOW, DIRECT, CEILING = "low", "direct", "ceiling"
Role = Literal["low", "direct", "ceiling"]
Key = tuple[str, str]
"""Role and method of a curve."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ChartSettings:
    """The settings that decide a chart's figures.

    Attributes
    ----------
    display : name or file of the display
    scale, spps : of the low-resolution renders: scale, and samples per pixel of each
    direct_spps : samples per pixel of the renders of every view
    methods, direct_methods : what finishes the low-resolution renders, and those of every view
    ours : the method that is held against the others
    reference_spp, lenses : of the reference: samples per pixel, and number of sampled lenses, None for all
    ceiling_spp : samples per pixel of the nearly noise-free low-resolution render, 0 for none
    repeats, render_repeats : timed runs of the second stage, and of every render
    """

    display: str
    scale: int
    spps: tuple[int, ...]
    direct_spps: tuple[int, ...]
    methods: tuple[str, ...]
    direct_methods: tuple[str, ...]
    ours: str
    reference_spp: int
    lenses: int | None
    ceiling_spp: int
    repeats: int
    render_repeats: int


@dataclasses.dataclass(frozen=True)
class Metrics:
    """Every metric of docs/reference/metrics.md; None stands for what is not known."""

    p: float | None
    ssim_eia: float | None
    ssim_eia_fg: float | None
    psnr_fg: float | None
    ssim_views_fg: float | None
    ssim_eia_plain: float | None
    ssim_ceiling: float | None
    flip: float | None
    recall: float | None


@dataclasses.dataclass(frozen=True)
class Spread:
    """Seconds end to end: the median, and from the least to the most that render and second stage took."""

    median: float
    least: float
    most: float


@dataclasses.dataclass(frozen=True)
class Cell:
    """One render, finished by one method.

    Attributes
    ----------
    role : what the render is for, one of LOW, DIRECT, CEILING
    method : what finished it
    scale, samples, device : of the render: scale, samples per pixel, and what Cycles ran on
    render_seconds, open_seconds : of every run of the render, and of opening the scene
    second_stage_seconds : of every run of the second stage
    stage_seconds : medians of the second stage's parts; "upscale" is the method itself
    seconds : end to end
    metrics : how near it comes to the reference
    ci95 : half-widths of the metrics' 95 % intervals, as far as they are known
    notes : sentences of the second stage
    load_average : how busy the machine was
    """

    role: Role
    method: str
    scale: int
    samples: int
    render_seconds: tuple[float, ...]
    open_seconds: float
    second_stage_seconds: tuple[float, ...]
    stage_seconds: dict[str, float]
    seconds: Spread
    metrics: Metrics
    ci95: dict[str, float | None]
    notes: tuple[str, ...]
    load_average: float | None
    device: str

    @property
    def key(self) -> tuple[str, str, int]:
        """Role, method and samples, which tell the cells of a scene apart."""
        return self.role, self.method, self.samples

    @property
    def render(self) -> float:
        """Median seconds of the render."""
        return statistics.median(self.render_seconds)

    @property
    def second_stage(self) -> float:
        """Median seconds of the second stage."""
        return statistics.median(self.second_stage_seconds)

    def value(self, metric: str) -> float | None:
        """One metric."""
        return getattr(self.metrics, metric)


@dataclasses.dataclass(frozen=True)
class Point:
    """One cell on the chart: ``value`` is higher where better, ``seconds`` > 0 are end to end."""

    role: Role
    method: str
    samples: int
    seconds: float
    value: float

    @property
    def curve(self) -> Key:
        """The curve it belongs to."""
        return self.role, self.method


@dataclasses.dataclass(frozen=True)
class Duel(Point):
    """One measured point, and how long another method needs for its accuracy.

    Attributes
    ----------
    needs_seconds : None where the other never gets there
    bound : the other is better already at its fewest samples, so it needs at most so many seconds
    ratio : the other's seconds over the point's
    outcome : ours
    """

    needs_seconds: float | None
    bound: bool
    ratio: float | None
    outcome: Literal["win", "loss"]


@dataclasses.dataclass(frozen=True)
class Goal:
    """How a method does against direct rendering with OIDN, over every accuracy that reaches at 1 to 4 samples.

    Attributes
    ----------
    from_value, to_value : the accuracies
    worst_ratio : of the method's seconds to the other's; None where it fails to reach one of the accuracies
    met, stretch_met : the ratio is at most TARGET, at most STRETCH
    """

    from_value: float
    to_value: float
    worst_ratio: float | None
    met: bool
    stretch_met: bool


@dataclasses.dataclass(frozen=True)
class Ceiling:
    """The best that a method makes of the nearly noise-free low-resolution render, by one metric."""

    method: str
    samples: int
    value: float


@dataclasses.dataclass(frozen=True)
class Analysis:
    """What the cells of a scene say by one metric; values whose less is better have their sign turned.

    Attributes
    ----------
    metric : one of METRICS
    ceiling : None where it was not measured
    front : the points that no other beats in both time and accuracy
    target, target_with_opening : of our method, without and with the time that opening the scene takes
    targets_of_others : the same of every other method
    versus : every point of every other method against our curve
    reverse : every point of ours against the curve of the method that is named
    """

    metric: Literal["ssim_eia_fg", "ssim_views_fg", "ssim_eia", "psnr_fg", "flip"]
    ceiling: Ceiling | None
    front: tuple[Point, ...]
    target: Goal | None
    target_with_opening: Goal | None
    targets_of_others: dict[str, Goal | None]
    versus: tuple[Duel, ...]
    reverse: tuple[Duel, ...]


@dataclasses.dataclass(frozen=True)
class UsedReference:
    """The reference of a scene: samples per pixel, number of sampled lenses (None for all), seconds it took."""

    samples: int
    lenses: int | None
    seconds: float

    @property
    def shown(self) -> str:
        """Its lenses in words."""
        return "every lens" if self.lenses is None else f"{self.lenses} lenses"


@dataclasses.dataclass(frozen=True)
class SceneRow:
    """One scene: its name, Blender's version, the share ``p`` of lenses with foreground, and all about it."""

    scene: str
    blender: str
    p: float
    reference: UsedReference
    cells: tuple[Cell, ...]
    analysis: tuple[Analysis, ...]

    @property
    def main(self) -> Analysis:
        """By the main metric."""
        return self.analysis[0]


@dataclasses.dataclass(frozen=True)
class MethodCost:
    """What a method costs.

    Attributes
    ----------
    method : its name
    parameters, multiply_adds_per_low_pixel : of its networks, None where it has none
    fresh_process_seconds : of `lfsr upscale` from its start
    """

    method: str
    parameters: int | None
    multiply_adds_per_low_pixel: float | None
    fresh_process_seconds: float | None


@dataclasses.dataclass(frozen=True)
class Chart:
    """A whole chart; ``skipped`` are sentences on what was left out."""

    format: int
    settings: ChartSettings
    environment: Environment
    methods: tuple[MethodCost, ...]
    skipped: tuple[str, ...]
    scenes: tuple[SceneRow, ...]


def read_chart(path: Path) -> Chart:
    """The chart in a file; LfsrError, one sentence, for the first thing in it that is not as it should be."""
    return chart_of(read_json(path, "a chart"), str(path))


def chart_of(data: object, source: str = "chart") -> Chart:
    """The chart that JSON data describes; ``source`` names the data in errors."""
    found = data.get("format") if isinstance(data, dict) else None
    if found != FORMAT:
        raise LfsrError(f"{source} has format {found!r}, but this version reads {FORMAT}: measure the chart again")
    return from_data(Chart, data, source)
