"""What follows from the measured values of a chart: means, times to equal error, and what is certain. Pure functions.

A statistic is computed for the values themselves and for every draw of the bootstrap of ``engine.seeds`` alike: arrays
end in an axis of 1 + DRAWS, the values themselves first. Repeated times are drawn anew too.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final, Literal

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.base.records import from_data
from lfsr_core.base.system import read_json
from lfsr_core.metrics.eia_metrics import NORMAL_95
from lfsr_lab.experiments.engine.report import Environment
from lfsr_lab.experiments.engine.seeds import DRAWS, Estimate, interval, replicates
from lfsr_lab.experiments.engine.truth import FLIP, MEASURES, RELMSE, SMAPE, SSIM

FORMAT = 2
Role = Literal["low", "direct"]
LOW: Final = "low"
DIRECT: Final = "direct"
Key = tuple[Role, str]  # role and method of a curve


@dataclasses.dataclass(frozen=True, kw_only=True)
class ChartSettings:
    display: str  # its name or file
    scale: int  # of the low-resolution renders
    spps: tuple[int, ...]  # samples per pixel of each low-resolution render
    direct_spps: tuple[int, ...]  # samples per pixel of each render of every view
    methods: tuple[str, ...]  # what finishes the low-resolution renders
    direct_methods: tuple[str, ...]  # what finishes the renders of every view
    ours: str  # the method that is held against the others
    reference_spp: int  # samples per pixel of the reference, both halves together
    lenses: int | None = None  # number of lenses that the reference samples, None for all
    seeds: int  # renders of each, with seeds from 0 on
    repeats: int  # timed runs of the second stage
    render_repeats: int = 0  # renders that were made again for their time, in older charts
    subject: str | None = None  # collection that is the foreground, None for all but one called Background
    world_visible: bool | None = None  # whether the world is seen behind the subject, None for what each scene says


@dataclasses.dataclass(frozen=True)
class Measured:
    """One method on all seeds of a render: by error, a row of one value per lens for each seed.

    ``bias2`` and ``variance`` have one row; they are missing where there is one seed.
    """

    values: dict[str, tuple[tuple[float, ...], ...]]

    def __post_init__(self) -> None:
        if len({len(row) for rows in self.values.values() for row in rows}) > 1:
            raise LfsrError("values have rows of other lengths, expected one value per lens")


@dataclasses.dataclass(frozen=True)
class Times:
    render_seconds: tuple[float, ...]  # of every run of the render
    second_stage_seconds: tuple[float, ...]  # of every run, from reading the render to the written PNG
    load_average: float | None  # of the machine, before the runs of the second stage

    @property
    def median(self) -> float:
        """End to end: the median render and the median second stage."""
        return statistics.median(self.render_seconds) + statistics.median(self.second_stage_seconds)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Cell:
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
        return self.role, self.method

    @property
    def rays(self) -> float:
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
    samples: int  # per pixel, both halves together
    lenses: int | None  # how many it shows, None for all
    counted: int  # lenses with foreground, over which errors are means
    seconds: float  # it took
    noise: dict[str, float]  # errors that the mean of its halves has itself


@dataclasses.dataclass(frozen=True)
class SceneRow:
    scene: str  # its name
    blender: str  # version that rendered the reference
    reference: UsedReference
    cells: tuple[Cell, ...]
    duels: tuple[Duel, ...]
    reaches: tuple[Reach, ...]


@dataclasses.dataclass(frozen=True)
class Chart:
    format: int
    settings: ChartSettings
    environment: Environment
    skipped: tuple[str, ...]  # sentences on what was left out
    scenes: tuple[SceneRow, ...]

    @property
    def timed(self) -> bool:
        return all(cell.seconds for scene in self.scenes for cell in scene.cells)


def read_chart(path: Path) -> Chart:
    """Read a chart; LfsrError, one sentence, for the first thing in it that is not as it should be."""
    data = read_json(path, "a chart")
    file_format = data.get("format") if isinstance(data, dict) else None
    if file_format != FORMAT:
        raise LfsrError(f"{path} has format {file_format!r}, but this version reads {FORMAT}: measure the chart again")
    return from_data(Chart, data, str(path))


FIXED = {SSIM: 0.1, RELMSE: 0.02, SMAPE: 0.2, FLIP: 0.2}  # errors to be reached
LEAST = 1e-7  # split errors can come out at 0 or below


@dataclasses.dataclass(frozen=True)
class Point:
    """One cell with its draws."""

    role: Role
    method: str
    scale: int
    samples: int
    drawn: dict[str, Array]  # by error, (1 + DRAWS,)
    seconds: Array | None  # (1 + DRAWS,)
    spreads: dict[str, float | None]  # over seeds, by error
    times: Times | None

    @classmethod
    def of(cls, role: Role, method: str, scale: int, samples: int, measured: Measured, times: Times | None,
           blocks: Array) -> Point:
        """Return the point of a measurement; ``blocks`` (n,): lenses of one number are drawn together."""
        values = {name: np.array(rows) for name, rows in measured.values.items()}
        drawn = {name: np.concatenate([[rows.mean()], replicates(rows, blocks)]) for name, rows in values.items()}
        spreads = {name: float(rows.mean(1).std(ddof=1)) if len(rows) > 1 else None for name, rows in values.items()}
        return cls(role, method, scale, samples, drawn, drawn_seconds(times) if times else None, spreads, times)

    @property
    def key(self) -> Key:
        return self.role, self.method

    @property
    def rays(self) -> Array:
        """Rays per finished pixel, (1,)."""
        return np.array([self.samples / self.scale**2])

    @property
    def cell(self) -> Cell:
        """What chart.json has of it."""
        return Cell(role=self.role, method=self.method, scale=self.scale, samples=self.samples,
                    errors={name: _estimate(drawn, self.spreads[name]) for name, drawn in self.drawn.items()},
                    seconds=None if self.seconds is None else _estimate(self.seconds),
                    second_stage=short(statistics.median(self.times.second_stage_seconds)) if self.times else None,
                    load_average=self.times.load_average if self.times else None)


def _estimate(drawn: Array, spread: float | None = None) -> Estimate:
    mean, (low, high) = float(drawn[0]), interval(drawn[1:])
    return Estimate(short(mean), short(low), short(high), spread and short(spread))


def drawn_seconds(times: Times) -> Array:
    """Return the seconds end to end, (1 + DRAWS,): repeats of the render and of the second stage drawn anew."""
    random = np.random.default_rng(0)
    parts = [np.array(runs)[random.integers(0, len(runs), (DRAWS, len(runs)))]
             for runs in (times.render_seconds, times.second_stage_seconds)]
    return np.concatenate([[times.median], sum(np.median(part, 1) for part in parts)])


def curves(points: Iterable[Point]) -> dict[Key, list[Point]]:
    """Return points by role and method, each curve by samples."""
    by_key: dict[Key, list[Point]] = {}
    for point in sorted(points, key=lambda point: point.samples):
        by_key.setdefault(point.key, []).append(point)
    return by_key


def reach(costs: Array, errors: Array, target: Array) -> tuple[Array, Array]:
    """Return the cost (draws,) at which a curve reaches an error, infinite for never, and whether it may need less.

    Between two points the logarithm of the cost is interpolated by that of the error. A point has the least
    error of those up to it, and the least cost of those from it on: what costs more is never worse.

    Parameters
    ----------
    costs : (points, draws) or (points, 1), by samples
    errors : (points, draws)
    target : (draws,)
    """
    best, wanted = np.log(np.maximum(np.minimum.accumulate(errors), LEAST)), np.log(np.maximum(target, LEAST))
    prices = np.log(np.minimum.accumulate(np.broadcast_to(costs, best.shape)[::-1])[::-1])
    met = best <= wanted
    after, draw = met.argmax(0), np.arange(best.shape[1])
    before = np.maximum(after - 1, 0)
    step = best[before, draw] - best[after, draw]
    part = np.divide(best[before, draw] - wanted, step, out=np.ones_like(step), where=step > 0)
    interpolated = np.exp(prices[before, draw] * (1 - part) + prices[after, draw] * part)
    return np.where(met.any(0), interpolated, np.inf), met[0] & (best[0] < wanted)


def cost(drawn: Array, bound: bool) -> Cost:
    """Return the value of draws (1 + DRAWS,) and its interval."""
    value, low, high = (short(figure) if np.isfinite(figure) else None for figure in (drawn[0], *interval(drawn[1:])))
    return Cost(value, low, high, bound)


def stack(curve: Sequence[Point], measure: str) -> tuple[Array, Array, Array | None]:
    """Return rays (points, 1), errors and seconds (points, 1 + DRAWS) of a curve; no seconds where one is not timed."""
    seconds = [point.seconds for point in curve if point.seconds is not None]
    return (np.array([point.rays for point in curve]), np.array([point.drawn[measure] for point in curve]),
            np.array(seconds) if len(seconds) == len(curve) else None)


def duels(points: Sequence[Point], ours: Key) -> list[Duel]:
    """Return what ours needs for the error of every measured point of every other method, by every measure."""
    by_key = curves(points)
    mine = by_key.get(ours, [])
    others = [point for key, curve in by_key.items() if key != ours for point in curve]
    fought = []
    for measure, point in itertools.product(MEASURES, others if mine else ()):
        rays, errors, seconds = stack(mine, measure)
        needed, bound = reach(rays, errors, point.drawn[measure])
        times = None
        if seconds is not None and point.seconds is not None:
            times = cost(reach(seconds, errors, point.drawn[measure])[0] / point.seconds, bool(bound[0]))
        fought.append(Duel(measure, *point.key, point.samples, cost(needed / point.rays, bool(bound[0])), times))
    return fought


def reaches(points: Sequence[Point], fixed: Mapping[str, float]) -> list[Reach]:
    reached = []
    for (measure, error), ((role, method), curve) in itertools.product(fixed.items(), curves(points).items()):
        rays, errors, seconds = stack(curve, measure)
        target = np.full(errors.shape[1], error)
        needed, bound = reach(rays, errors, target)
        times = None if seconds is None else cost(reach(seconds, errors, target)[0], bool(bound[0]))
        reached.append(Reach(measure, error, role, method, cost(needed, bool(bound[0])), times))
    return reached


def mean_duels(scenes: Sequence[SceneRow]) -> list[MeanDuel]:
    """Return the geometric means of the duels that every scene has, over the scenes in which ours gets there."""
    by_key: dict[tuple[str, Role, str, int], list[Duel]] = {}
    for duel in (duel for scene in scenes for duel in scene.duels):
        by_key.setdefault((duel.measure, duel.role, duel.method, duel.samples), []).append(duel)
    means = []
    for key, every in by_key.items():
        if len(every) == len(scenes):
            reached = [duel for duel in every if duel.rays.value is not None]
            seconds = [duel.seconds for duel in reached if duel.seconds is not None]
            means.append(MeanDuel(*key, len(reached), geometric_mean([duel.rays for duel in reached]),
                                  geometric_mean(seconds) if len(seconds) == len(reached) else None))
    return means


def geometric_mean(costs: Sequence[Cost]) -> Cost:
    """Return the geometric mean of costs, one per scene, with an interval over scenes.

    Each draw takes as many scenes anew, each moved at random by what its own interval leaves open.
    """
    values = [cost.value for cost in costs if cost.value is not None]
    if len(values) < 2:
        return costs[0] if costs else Cost(None, None, None, False)
    logs, count, random = np.log(values), len(values), np.random.default_rng(len(values))
    open_ = []  # standard errors of the logarithms; those of the lower half where there is no upper end
    for cost, value in zip(costs, values, strict=True):
        low = cost.low or value
        open_.append(float(np.log((cost.high or value**2 / low) / low)) / (2 * NORMAL_95))
    chosen = random.integers(0, count, (DRAWS, count))
    drawn = np.exp((logs[chosen] + np.array(open_)[chosen] * random.normal(size=(DRAWS, count))).mean(1))
    low, high = interval(drawn)
    certain = all(cost.high is not None for cost in costs)
    return Cost(short(np.exp(logs.mean())), short(low), short(high) if certain else None,
                any(cost.bound for cost in costs))


def mean_cells(scenes: Sequence[SceneRow]) -> list[Cell]:
    """Return the cells that every scene has: means of errors and geometric means of times over these very scenes."""
    tables = [{(cell.key, cell.samples): cell for cell in scene.cells} for scene in scenes]
    means = []
    for key in (key for key in tables[0] if all(key in table for table in tables)):
        cells = [table[key] for table in tables]
        errors = {name: mean_estimate([cell.errors[name] for cell in cells]) for name in cells[0].errors
                  if all(name in cell.errors for cell in cells)}
        seconds = None
        if all(cell.seconds for cell in cells):
            logs = mean_estimate([Estimate(math.log(cost.mean), math.log(cost.low), math.log(cost.high), None)
                                  for cell in cells if (cost := cell.seconds)])
            seconds = Estimate(short(math.exp(logs.mean)), short(math.exp(logs.low)), short(math.exp(logs.high)), None)
        means.append(dataclasses.replace(cells[0], errors=errors, seconds=seconds, second_stage=None,
                                         load_average=None))
    return means


def mean_estimate(every: Sequence[Estimate]) -> Estimate:
    """Return the mean of independent estimates, as for these very scenes."""
    mean, low, high = (np.array([vars(estimate)[name] for estimate in every]) for name in ("mean", "low", "high"))
    spreads = [estimate.spread for estimate in every if estimate.spread is not None]
    below, above = (np.sqrt(np.sum(part**2)) / len(mean) for part in (mean - low, high - mean))
    return Estimate(short(mean.mean()), short(mean.mean() - below), short(mean.mean() + above),
                    short(float(np.mean(spreads))) if spreads else None)


def short(value: float) -> float:
    """Return a figure with five digits."""
    return float(f"{value:.5g}")
