"""What chart.json holds, as records: ``Chart`` is the whole file; see docs/reference/chart.md.

Errors have the names and meanings of ``engine.measures``; less is better. The values of every seed and lens, from which
means and intervals follow, are in SCENE/cells/RENDER-METHOD.json (``Measured``) of the chart's folder.
"""

from __future__ import annotations

import dataclasses
import statistics
from pathlib import Path
from typing import Final, Literal

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import read_json
from lfsr_core.base.records import from_data
from lfsr_lab.experiments.engine.environment import Environment
from lfsr_lab.experiments.engine.seeds import Estimate

FORMAT = 2
Role = Literal["low", "direct"]
LOW: Final = "low"
DIRECT: Final = "direct"
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
    reference_spp: int  # samples per pixel of the reference, both halves together
    lenses: int | None  # number of lenses that the reference samples, None for all
    seeds: int  # renders of each, with seeds from 0 on
    repeats: int  # timed runs of the second stage
    render_repeats: int  # renders that are made again for their time; 0: those of all seeds are counted
    subject: str | None = None  # collection that is the foreground, None for all but one called Background
    world_visible: bool | None = None  # whether the world is seen behind the subject, None for what each scene says


@dataclasses.dataclass(frozen=True)
class Measured:
    """One method on all seeds of a render: by error, a row of one value per lens for each seed.

    ``bias2`` and ``variance`` have one row; they are missing where there is one seed.
    """

    values: dict[str, tuple[tuple[float, ...], ...]]


@dataclasses.dataclass(frozen=True)
class Times:
    """Seconds of one render and method."""

    render_seconds: tuple[float, ...]  # of every run of the render
    second_stage_seconds: tuple[float, ...]  # of every run, from reading the render to the written PNG
    load_average: float | None  # of the machine, before the runs of the second stage

    @property
    def median(self) -> float:
        """End to end: the median render and the median second stage."""
        return statistics.median(self.render_seconds) + statistics.median(self.second_stage_seconds)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Cell:
    """One render with all its seeds, finished by one method."""

    role: Role  # what the render is for
    method: str  # what finished it
    scale: int  # of the render
    samples: int  # per pixel of the render
    errors: dict[str, Estimate]  # over seeds and foreground lenses
    seconds: Estimate | None  # end to end, None where it was not timed; no spread
    second_stage: float | None  # median seconds of the second stage alone
    load_average: float | None  # of the machine when it was timed

    @property
    def key(self) -> Key:
        """The curve it belongs to."""
        return self.role, self.method

    @property
    def rays(self) -> float:
        """Rays per finished pixel."""
        return self.samples / self.scale**2


@dataclasses.dataclass(frozen=True)
class Cost:
    """What a method needs to reach an error: seconds, rays per finished pixel, or what ours needs over the other's."""

    value: float | None  # None where the error is never reached
    low: float | None  # ends of the 95 % interval over seeds and lenses; None where it is not reached in so many draws
    high: float | None
    bound: bool  # the error is less already at the fewest samples, so that at most this is needed


@dataclasses.dataclass(frozen=True)
class Duel:
    """One measured point of another method, and what ours needs to reach its error."""

    measure: str
    role: Role  # of the other
    method: str
    samples: int  # of the other, per pixel
    rays: Cost  # ours over the other's
    seconds: Cost | None  # likewise; None where one of both was not timed

    @property
    def key(self) -> Key:
        """The other's curve."""
        return self.role, self.method


@dataclasses.dataclass(frozen=True)
class Reach:
    """What a method needs to reach a fixed error."""

    measure: str
    error: float
    role: Role
    method: str
    rays: Cost
    seconds: Cost | None  # None where it was not timed


@dataclasses.dataclass(frozen=True)
class MeanDuel:
    """The geometric mean of a duel's ratios over the scenes in which ours gets there; not in chart.json."""

    measure: str
    role: Role
    method: str
    samples: int
    scenes: int  # in which ours gets there
    rays: Cost  # its interval is over scenes, seeds and lenses
    seconds: Cost | None


@dataclasses.dataclass(frozen=True)
class UsedReference:
    """The reference of a scene."""

    samples: int  # per pixel, both halves together
    lenses: int | None  # how many it shows, None for all
    counted: int  # lenses with foreground, over which errors are means
    seconds: float  # it took
    noise: dict[str, float]  # errors that the mean of its halves has itself


@dataclasses.dataclass(frozen=True)
class SceneRow:
    """One scene."""

    scene: str  # its name
    blender: str  # version that rendered the reference
    reference: UsedReference
    cells: tuple[Cell, ...]
    duels: tuple[Duel, ...]
    reaches: tuple[Reach, ...]


@dataclasses.dataclass(frozen=True)
class Chart:
    """A whole chart."""

    format: int
    settings: ChartSettings
    environment: Environment
    skipped: tuple[str, ...]  # sentences on what was left out
    scenes: tuple[SceneRow, ...]

    @property
    def timed(self) -> bool:
        """Whether every cell has times."""
        return all(cell.seconds for scene in self.scenes for cell in scene.cells)


def read_chart(path: Path) -> Chart:
    """Read a chart; LfsrError, one sentence, for the first thing in it that is not as it should be."""
    data = read_json(path, "a chart")
    found = data.get("format") if isinstance(data, dict) else None
    if found != FORMAT:
        raise LfsrError(f"{path} has format {found!r}, but this version reads {FORMAT}: measure the chart again")
    return from_data(Chart, data, str(path))
