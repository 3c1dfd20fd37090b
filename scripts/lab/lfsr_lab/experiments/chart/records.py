"""What chart.json holds, as records; see docs/reference/chart.md."""

from __future__ import annotations

import dataclasses
import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Final, Literal

from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json
from lfsr_core.records import from_data
from lfsr_lab.experiments.engine.accuracy import MAIN_METRICS, Accuracy
from lfsr_lab.experiments.engine.environment import Environment
from lfsr_lab.experiments.engine.timing import StageTimes

FORMAT = 1
Role = Literal["low", "direct", "ceiling"]
LOW: Final = "low"
DIRECT: Final = "direct"
CEILING: Final = "ceiling"
Key = tuple[Role, str]  # role and method of a curve


@dataclasses.dataclass(frozen=True, kw_only=True)
class ChartSettings:
    """The settings that decide a chart's figures."""

    display: str  # its name or file
    scale: int  # of the low-resolution renders
    spps: tuple[int, ...]  # samples per pixel of each low-resolution render
    direct_spps: tuple[int, ...]  # samples per pixel of each render of every view
    methods: tuple[str, ...]  # what finishes the low-resolution renders
    direct_methods: tuple[str, ...]  # what finishes the renders of every view
    ours: str  # the method that is held against the others
    reference_spp: int  # samples per pixel of the reference
    lenses: int | None  # number of lenses that the reference samples, None for all
    ceiling_spp: int  # samples per pixel of the nearly noise-free low-resolution render, 0 for none
    repeats: int  # timed runs of the second stage
    render_repeats: int  # timed runs of every render
    seed: int = 0  # of the noise of all renders but the reference
    subject: str | None = None  # collection that is the foreground, None for all but one called Background
    world_visible: bool | None = None  # whether the world is seen behind the subject, None for what each scene says


@dataclasses.dataclass(frozen=True)
class Spread:
    """Seconds end to end: the median, and from the least to the most that render and second stage took."""

    median: float
    least: float
    most: float

    @classmethod
    def of(cls, render: Sequence[float], second: Sequence[float]) -> Spread:
        """Return the seconds end to end of every run of a render and of the second stage."""
        median = statistics.median(statistics.median(render) + seconds for seconds in second)
        return cls(median, min(render) + min(second), max(render) + max(second))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Cell(Accuracy, StageTimes):
    """One render, finished by one method: its accuracy, the times of the second stage, and those of the render."""

    role: Role  # what the render is for
    method: str  # what finished it
    scale: int  # of the render
    samples: int  # per pixel of the render
    render_seconds: tuple[float, ...]  # of every run of the render
    open_seconds: float  # of opening the scene
    seconds: Spread  # end to end
    device: str  # what Cycles ran on

    @property
    def key(self) -> tuple[Role, str, int]:
        """Role, method and samples, which tell the cells of a scene apart."""
        return self.role, self.method, self.samples

    @property
    def second_stage(self) -> float:
        """Median seconds of the second stage."""
        return statistics.median(self.second_stage_seconds)


@dataclasses.dataclass(frozen=True)
class Point:
    """One cell on the chart."""

    role: Role
    method: str
    samples: int  # per pixel
    seconds: float  # end to end, more than 0
    value: float  # higher where better

    @property
    def curve(self) -> Key:
        """The curve it belongs to."""
        return self.role, self.method


@dataclasses.dataclass(frozen=True)
class Duel(Point):
    """One measured point, and how long another method needs for its accuracy."""

    needs_seconds: float | None  # None where the other never gets there
    bound: bool  # the other is better already at its fewest samples, so it needs at most so many seconds
    ratio: float | None  # the other's seconds over the point's
    outcome: Literal["win", "loss"]  # ours


@dataclasses.dataclass(frozen=True)
class Goal:
    """How a method does against direct rendering with OIDN, over every accuracy that reaches at 1 to 4 samples."""

    from_value: float  # least of the accuracies
    to_value: float  # greatest of them
    worst_ratio: float | None  # of the method's seconds to the other's; None where it fails to reach an accuracy
    met: bool  # the ratio is at most TARGET
    stretch_met: bool  # the ratio is at most STRETCH


@dataclasses.dataclass(frozen=True)
class Ceiling:
    """The best that a method makes of the nearly noise-free low-resolution render, by one metric."""

    method: str
    samples: int
    value: float


@dataclasses.dataclass(frozen=True)
class Analysis:
    """What follows from the cells of a scene by one metric; values whose less is better have their sign turned."""

    metric: str
    ceiling: Ceiling | None  # None where it was not measured
    front: tuple[Point, ...]  # the points that no other beats in both time and accuracy
    target: Goal | None  # of our method
    target_with_opening: Goal | None  # with the time that opening the scene takes
    targets_of_others: dict[str, Goal | None]  # of every other method in our place
    versus: tuple[Duel, ...]  # every point of every other method against our curve
    reverse: tuple[Duel, ...]  # every point of ours against the curve of the method that is named


@dataclasses.dataclass(frozen=True)
class UsedReference:
    """The reference of a scene."""

    samples: int  # per pixel
    lenses: int | None  # how many it shows, None for all
    seconds: float  # it took


@dataclasses.dataclass(frozen=True)
class SceneRow:
    """One scene."""

    scene: str  # its name
    blender: str  # version that rendered the reference
    p: float  # fraction of lenses with foreground
    reference: UsedReference
    cells: tuple[Cell, ...]
    analysis: tuple[Analysis, ...]

    def by(self, metric: str) -> Analysis:
        """The analysis by one metric; LfsrError where the scene was not analysed by it."""
        found = next((part for part in self.analysis if part.metric == metric), None)
        if found is None:
            raise LfsrError(f"scene {self.scene} was not analysed by {metric}: measure the chart again")
        return found


@dataclasses.dataclass(frozen=True)
class MethodCost:
    """What a method costs."""

    method: str  # its name
    parameters: int | None  # of its networks, None where it has none
    multiply_adds_per_low_pixel: float | None  # of its networks, None where it has none
    fresh_process_seconds: float | None  # of `lfsr upscale` from its start


@dataclasses.dataclass(frozen=True)
class Chart:
    """A whole chart."""

    format: int
    settings: ChartSettings
    environment: Environment
    methods: tuple[MethodCost, ...]
    skipped: tuple[str, ...]  # sentences on what was left out
    scenes: tuple[SceneRow, ...]

    @property
    def metric(self) -> str:
        """What the chart is judged by: the first of MAIN_METRICS that all of its scenes know."""
        known = [{name for cell in scene.cells for name, value in cell.metrics.items() if value is not None}
                 for scene in self.scenes]
        return next((name for name in MAIN_METRICS if all(name in names for names in known)), MAIN_METRICS[0])


def read_chart(path: Path) -> Chart:
    """Read a chart; LfsrError, one sentence, for the first thing in it that is not as it should be."""
    data = read_json(path, "a chart")
    found = data.get("format") if isinstance(data, dict) else None
    if found != FORMAT:
        raise LfsrError(f"{path} has format {found!r}, but this version reads {FORMAT}")
    return from_data(Chart, data, str(path))
