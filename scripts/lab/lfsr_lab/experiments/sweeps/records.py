"""Records of the parameter sweeps: settings, one per cell, and the report in stress.json."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from statistics import fmean

import numpy as np

from lfsr_core.base.messages import LfsrError, did_you_mean
from lfsr_core.optics.display import DisplayProfile
from lfsr_lab.experiments.engine.records import StudySettings
from lfsr_lab.experiments.engine.report import Environment
from lfsr_lab.experiments.engine.seeds import Estimate, estimate
from lfsr_lab.experiments.engine.truth import Metrics

SAMPLES = 16


@dataclasses.dataclass(frozen=True)
class Sweep:
    name: str  # as on the command line and in the names of folders
    meaning: str  # what a value is
    unit: str  # of the values
    values: tuple[float, ...]  # from easy to hard, the first of them the start
    quick: tuple[float, ...]  # the part of them that a quick run measures
    judged: str = "ssim_eia_fg"  # the metric, larger is better, that breaks
    # The one scene of all values, which then are samples per pixel; None where each value has its own.
    scene: str | None = None

    def scene_name(self, value: float) -> str:
        return self.scene or f"{self.name}-{label(value)}"

    def samples(self, value: float) -> int:
        """Return the samples per pixel of the low-resolution render of one value."""
        return int(value) if self.scene else SAMPLES


def label(value: float) -> str:
    """Return a value of a sweep as text, also in file names."""
    return f"{value:g}"


SWEEPS: tuple[Sweep, ...] = (
    Sweep("samples", "samples per pixel of a scene with every kind of material, half a usable range deep",
         "samples per pixel", (64, 32, 16, 8, 4, 2, 1), (64, 16, 1), scene="samples"),
    Sweep("depth-behind", "textured bodies behind the display plane", "usable depths at this scale",
         (0, 0.5, 1, 1.5, 2, 2.5, 3), (0, 1, 3)),
    Sweep("depth-range", "the same bodies spread from before the display to behind it", "usable depths to either side",
         (0, 0.5, 1, 1.5, 2, 2.5, 3), (0, 1, 3)),
    Sweep("wire", "thickness of crossing wires, half a usable depth behind the display",
         "high-resolution pixels at the wires' depth", (2, 1, 1 / 2, 1 / 4, 1 / 8, 1 / 16), (2, 1 / 2, 1 / 8)),
    Sweep("texture", "frequency of a sine grating at the far usable depth", "Nyquist frequencies of the rendered views",
         (1 / 8, 1 / 4, 1 / 2, 3 / 4, 1, 1.5, 2), (1 / 8, 1, 1.5)),
    Sweep("glass-texture", "width of the tiles of a board behind smooth glass bodies", "lens pitches",
         (12, 6, 3, 2, 1.5, 1, 0.75), (12, 2, 0.75)),
    Sweep("glass-roughness", "roughness of the same glass before tiles 1.5 lenses wide", "Cycles roughness",
         (0, 0.05, 0.1, 0.2, 0.4, 0.8), (0, 0.1, 0.8)),
    Sweep("mirror", "distance of a mirror image behind the mirror on the display plane", "usable depths at this scale",
         (0.5, 1, 1.5, 2, 2.5, 3), (0.5, 1, 3)),
    Sweep("caustics", "angle of the only lamp, whose light reaches the floor through glass and off a metal ring",
         "degrees across", (90, 60, 40, 25, 15, 8), (90, 40, 8)),
    Sweep("lamps", "radius of glowing balls of constant power beside dark surfaces",
         "high-resolution pixels at the display plane", (1 / 2, 1 / 4, 1 / 8, 1 / 16, 1 / 32, 1 / 64),
         (1 / 2, 1 / 8, 1 / 64)),
    Sweep("glitter", "density of flakes of metal under a small lamp", "flakes per lens",
         (1 / 4, 1, 4, 16, 64, 256), (1 / 4, 4, 256)),
    Sweep("share", "fraction p of lenses that see the foreground through a hole in a card on the display plane",
         "fraction of lenses", (1, 0.75, 0.5, 0.25, 0.1, 0.05, 0.02), (1, 0.25, 0.02)),
    Sweep("background", "brightness of a plain background; the grey subject stays", "times the subject's brightness",
         (0, 1 / 4, 1 / 2, 3 / 4, 7 / 8, 1), (0, 1 / 2, 1)),
    Sweep("border", "contrast of glossy metal tiles, one per lens, whose edges are the lenses' edges; dark ones stay",
         "Michelson contrast", (0, 0.25, 0.5, 0.7, 0.8, 0.9), (0, 0.5, 0.9), judged="ssim_border"),
    Sweep("motion", "sideways steps per frame of a printed card that goes round a rectangle",
         "lenses per frame", (0, 1, 2), (0, 1), judged="steadiness"),
    Sweep("eye", "slope of a finely printed board: what the eye meets when it moves by one rendered view",
         "lens pitches per rendered view", (1 / 4, 1 / 2, 1, 2, 4), (1 / 4, 1, 4), judged="epi_straightness"),
    Sweep("recall", "diameter of single bright specks scattered before and behind the display plane",
         "high-resolution pixels at their depth", (1, 1 / 2, 1 / 4, 1 / 8, 1 / 16, 1 / 32), (1, 1 / 4, 1 / 32),
         judged="recall"),
)
MOTION, EYE = "motion", "eye"


def choose_sweeps(names: Sequence[str] | None) -> tuple[Sweep, ...]:
    """Return the sweeps of these names in the order above, all without names; LfsrError for an unknown name."""
    choices = [sweep.name for sweep in SWEEPS]
    for name in names or ():
        if name not in choices:
            hint = did_you_mean(name, choices, cutoff=0.4)
            raise LfsrError(f"there is no sweep {name!r}: {hint}Choose from {', '.join(choices)}")
    return tuple(sweep for sweep in SWEEPS if not names or sweep.name in names)


DROP = 0.05       # how far below its own start a method counts as broken
TOLERANCE = 1e-9  # rounding of the difference of two measured figures
BELOW_BICUBIC, BELOW_START = "below bicubic", "below its start"
Judged = Mapping[float, Sequence[float | None]]
"""Judged figures by value of a sweep, one per seed; None where one could not be measured."""


@dataclasses.dataclass(frozen=True)
class Break:
    value: float  # of the sweep
    quality: float  # the judged figure there, mean over seeds
    reason: str  # BELOW_BICUBIC or BELOW_START
    # Where it breaks with 95 % confidence over the seeds: the first value at which it may be broken, and the first at
    # which it surely is. None with one seed, ``latest`` also where it is sure at no value.
    earliest: float | None = None
    latest: float | None = None


@dataclasses.dataclass(frozen=True)
class Margin:
    """How far a method is above one of its limits at one value; it breaks at 0."""

    value: float  # of the sweep
    quality: float  # the judged figure, mean over seeds
    limit: str  # BELOW_BICUBIC or BELOW_START
    above: Estimate  # over seeds


def breaking_point(values: Sequence[float], quality: Judged, bicubic: Judged | None = None) -> Break | None:
    """Return where a method breaks: its first value below ``bicubic``, or DROP below its own start.

    Parameters
    ----------
    values : of the sweep, from easy to hard; the start is the first of them with a quality
    quality : the method's; values without one are passed over
    bicubic : bicubic's with the same seeds, None where it is not compared

    Returns
    -------
    None where the method never breaks on the mean over seeds
    """
    margins = list(_margins(values, quality, bicubic or {}))
    broken = next((margin for margin in margins if margin.above.mean <= 0), None)
    if broken is None:
        return None
    sure = [margin for margin in margins if margin.above.spread is not None]
    earliest = next((margin.value for margin in sure if margin.above.low <= 0), None)
    latest = next((margin.value for margin in sure if margin.above.high <= 0), None)
    return Break(broken.value, broken.quality, broken.limit, earliest, latest)


def near_breaks(values: Sequence[float], breaks: Iterable[Break | None]) -> set[float]:
    """Return the values that decide where methods break: those of ``breaks``, their neighbours, and the start."""
    places = [values.index(broken.value) for broken in breaks if broken]
    return {values[near] for place in places for near in (0, place - 1, place, place + 1) if 0 <= near < len(values)}


def _margins(values: Sequence[float], quality: Judged, bicubic: Judged) -> Iterator[Margin]:
    """Yield the margins at every value where the method was measured, paired by seed."""
    start: Sequence[float | None] = ()
    for value in values:
        own = quality.get(value, ())
        measured = [figure for figure in own if figure is not None]
        start = start or measured
        limits = ((BELOW_BICUBIC, bicubic.get(value, ()), TOLERANCE), (BELOW_START, start, DROP - TOLERANCE))
        for limit, others, allowed in limits:
            above = [figure - other + allowed for figure, other in zip(own, others, strict=False)
                     if figure is not None and other is not None]
            if above:
                yield Margin(value, fmean(measured), limit, estimate(np.array(above)[:, None]))


FORMAT = 1
MARKS = {BELOW_BICUBIC: "b", BELOW_START: "s"}
# Figures of some sweeps beside the judged one.
EXTRAS = {"border": ("rmse_border", "rmse_centre", "border_ratio", "ssim_centre"),
          "motion": ("flicker_fixed", "flicker_changing", "ssim_eia_fg"),
          "eye": ("neighbour_error", "ssim_eia_fg"), "recall": ("ssim_eia_fg",), "wire": ("recall",), "share": ("p",)}


@dataclasses.dataclass(frozen=True)
class Settings(StudySettings):
    """What decides every figure of a folder besides the sweeps and methods."""

    display: DisplayProfile  # that all scenes are made for
    scale: int  # of the low-resolution renders, at least 2
    reference_samples: int  # per pixel, of both halves of a reference together
    frames: int  # of the moving card
    device: str = "CPU"  # Cycles device
    format: int = FORMAT  # of the files

    def __post_init__(self) -> None:
        self.display.low_views(self.scale)
        if self.scale < 2:
            raise LfsrError(f"scale is {self.scale}, but the sweeps compare upscaling methods: choose 2 or more")
        if self.reference_samples < 2 or self.frames < 2:
            raise LfsrError(f"a reference has {self.reference_samples} samples and the motion {self.frames} frames, "
                            "but both need at least 2")

    def __str__(self) -> str:
        (sx, sy), (px, py) = self.display.lenses, self.display.views
        return (f"Display {self.display.name}, {sx}×{sy} lenses of {px}×{py} views, s = {self.scale}; references of "
                f"{self.reference_samples} samples in two halves; 16 samples per pixel unless the sweep says "
                f"otherwise; {self.frames} frames of motion.")


@dataclasses.dataclass(frozen=True)
class Cell:
    value: float  # of the sweep
    scene: str  # folder of the scene
    samples: int  # per pixel of the low-resolution render
    method: str  # its name
    metrics: Metrics  # figures by name, None where one could not be measured
    # (row, column) of the foreground lens with the largest error, None without foreground.
    worst_lens: tuple[int, int] | None
    weights: str = ""  # SHA-256 over the files of the method's weights, empty without
    versions: dict[str, int] = dataclasses.field(default_factory=dict)  # of the method's parts that have one, by name


@dataclasses.dataclass(frozen=True)
class Repeat:
    """The judged figures of one method at one value with several seeds."""

    value: float  # of the sweep
    method: str  # its name
    figures: tuple[float | None, ...]  # of seeds 0, 1, …; the first is that of the cell


@dataclasses.dataclass(frozen=True)
class SweepReport:
    name: str  # as of the sweep
    meaning: str  # as of the sweep
    unit: str  # as of the sweep
    judged: str  # as of the sweep
    values: tuple[float, ...]  # that were measured, from easy to hard
    cells: tuple[Cell, ...]  # one per value and method
    breaks: dict[str, Break | None]  # where each method breaks, None where it never does
    repeats: tuple[Repeat, ...] = ()  # one per method and value that was measured with more than one seed

    @property
    def span(self) -> str:
        return f"{label(self.values[0])} – {label(self.values[-1])}"

    @property
    def shown(self) -> tuple[str, ...]:
        """Metrics that deserve a table, the judged one first."""
        return (self.judged, *EXTRAS.get(self.name, ()))

    def series(self, method: str, metric: str) -> list[float | None]:
        """One metric of one method along the sweep; the judged one is the mean over the seeds."""
        by_value = {cell.value: cell.metrics.get(metric) for cell in self.cells if cell.method == method}
        if metric == self.judged:
            measured = {value: [figure for figure in figures if figure is not None]
                        for value, figures in self.figures(method).items()}
            by_value |= {value: fmean(figures) for value, figures in measured.items() if figures}
        return [by_value[value] for value in self.values]

    def figures(self, method: str) -> dict[float, tuple[float | None, ...]]:
        """Judged figures of a method by value, one per seed."""
        first = {cell.value: (cell.metrics.get(self.judged),) for cell in self.cells if cell.method == method}
        return first | {repeat.value: repeat.figures for repeat in self.repeats if repeat.method == method}

    def break_text(self, method: str) -> str:
        if all(value is None for value in self.series(method, self.judged)):
            return "?"
        broken = self.breaks[method]
        if broken is None:
            return "–"
        text = f"{label(broken.value)} {MARKS[broken.reason]}"
        if broken.earliest is None or broken.earliest == broken.latest:
            return text
        return f"{text} ({label(broken.earliest)} to {'?' if broken.latest is None else label(broken.latest)})"


@dataclasses.dataclass(frozen=True)
class Report:
    format: int  # of the file
    settings: Settings  # of the folder
    environment: Environment  # of the machine that wrote the report
    methods: tuple[str, ...]  # their names, bicubic first
    sweeps: tuple[SweepReport, ...] = dataclasses.field(metadata={"key": "dials"})
