"""What a chart says: sentences and tables made from its numbers, the same for its page and its Markdown file."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence

from lfsr_lab.experiments.chart.analysis import DIRECT, Cell, Chart, Cost, Duel, Key, mean_cells, mean_duels
from lfsr_lab.experiments.engine.plots import time_text
from lfsr_lab.experiments.engine.report import UNKNOWN, markdown_table, number
from lfsr_lab.experiments.engine.truth import LABELS, MEASURES, PARTS, SSIM

RIVAL: Key = (DIRECT, "oidn")
SHORT = {name: LABELS[name].partition(",")[0] for name in (*MEASURES, *PARTS)}


@dataclasses.dataclass(frozen=True)
class Table:
    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    align: str = "lr"  # a letter per column, "l" or "r"; the last one stands for all further columns

    @property
    def left(self) -> list[int]:
        return [index for index, letter in enumerate(self.align) if letter == "l"]


def label(key: Key, ours: str) -> str:
    role, name = key
    if role == DIRECT:
        return "every view" if name == "none" else f"every view +{name.upper() if name == RIVAL[1] else name}"
    return f"{name} (ours)" if name == ours else name


def headline(chart: Chart) -> str:
    """Return in one sentence what ours needs for the SSIM of rendering all views with OIDN."""
    means = [duel for duel in mean_duels(chart.scenes) if (duel.measure, duel.role, duel.method) == (SSIM, *RIVAL)]
    if not means:
        return "Direct high-resolution rendering with OIDN was not measured."
    parts = []
    for duel in means:
        ratios = [cost.value for scene in chart.scenes for one in scene.duels
                  if (one.measure, one.key, one.samples) == (duel.measure, (duel.role, duel.method), duel.samples)
                  and (cost := one.seconds or one.rays).value is not None]
        span = f", {percent(min(ratios))} to {percent(max(ratios))}" if len(ratios) > 1 else ""
        parts.append(f"{cost_text(duel.seconds or duel.rays, percent)} of {'the time' if duel.seconds else 'the rays'} "
                     f"at {duel.samples} sample{'s' if duel.samples > 1 else ''} ({duel.scenes} of {len(chart.scenes)} "
                     f"scenes{span})")
    return f"For the same SSIM as rendering every view with OIDN, {chart.settings.ours} needs {'; '.join(parts)}."


def percent(value: float) -> str:
    """Return a ratio as a percentage with two digits."""
    return f"{100 * value:.2g} %" if value < 1 else f"{100 * value:.0f} %"


def ratio(value: float) -> str:
    """Return a ratio with two digits behind the point."""
    return f"{value:.2f}" if value < 10 else f"{value:.0f}"


def cost_text(cost: Cost | None, text: Callable[[float], str] = ratio) -> str:
    """Return a cost with its interval: "never" where the error is not reached, ≤ where only a bound is known."""
    if cost is None:
        return UNKNOWN
    if cost.value is None:
        return "never"
    ends = ["∞" if end is None else text(end) for end in (cost.low, cost.high)]
    return f"{'≤ ' if cost.bound else ''}{text(cost.value)}" + (f" ({'–'.join(ends)})" if ends[0] != ends[1] else "")


def losses(chart: Chart) -> list[str]:
    """Return a sentence for every method that needs less than ours somewhere, or one that there is none."""
    ours, sentences = chart.settings.ours, []
    for key in dict.fromkeys(duel.key for scene in chart.scenes for duel in scene.duels):
        duels = [duel for scene in chart.scenes for duel in scene.duels if duel.key == key]
        lost = [f"{SHORT[measure]} {count} of {sum(duel.measure == measure for duel in duels)} times"
                for measure in MEASURES if (count := sum(duel.measure == measure and is_lost(duel) for duel in duels))]
        if lost:
            sentences.append(f"{label(key, ours)}: {', '.join(lost)}")
    return sentences or [f"{ours} needs more than no method that was measured, at no error, on no scene."]


def is_lost(duel: Duel) -> bool:
    """Whether ours needs as much as the other or more, or never gets there; not if it has less error for as much."""
    cost = duel.seconds or duel.rays
    return cost.value is None or cost.value > 1 or (cost.value == 1 and not cost.bound)


def markdown(chart: Chart) -> str:
    tables = [equal_error(chart), *duels(chart), *fixed(chart), noise(chart), *numbers(chart)]
    parts = [[f"## {table.title}", "", *markdown_table(table.header, table.rows, table.align), ""] for table in tables]
    return "\n".join([headline(chart), "", *(line for part in parts for line in part)])


def cost_name(chart: Chart) -> str:
    return "seconds" if chart.timed else "rays"


def equal_error(chart: Chart) -> Table:
    """Return the geometric means over scenes of what ours needs at the error of each other method."""
    ours, rows, means = chart.settings.ours, [], mean_duels(chart.scenes)
    for key, samples in dict.fromkeys(((duel.role, duel.method), duel.samples) for duel in means):
        every = {duel.measure: duel for duel in means if (duel.role, duel.method, duel.samples) == (*key, samples)}
        first = every[SSIM]
        rows.append([label(key, ours), str(samples), f"{cost_text(first.rays)}",
                     *(cost_text(duel.seconds or duel.rays) + ("" if duel.scenes == len(chart.scenes) else
                       f", {duel.scenes} of {len(chart.scenes)} scenes") for duel in every.values())])
    header = ("other method", "its samples", "SSIM, rays", *(f"{SHORT[name]}, {cost_name(chart)}" for name in MEASURES))
    return Table(f"What {ours} needs for the same error, over what the other needs", header, rows, "lr")


def duels(chart: Chart) -> list[Table]:
    """Return a table of ours against every other method, scene by scene, direct rendering with OIDN first."""
    rows: dict[Key, list[list[str]]] = {}
    for scene in chart.scenes:
        for key, samples in dict.fromkeys((duel.key, duel.samples) for duel in scene.duels):
            every = [duel for duel in scene.duels if (duel.key, duel.samples) == (key, samples)]
            rows.setdefault(key, []).append([
                scene.scene, str(samples), *(("✘ " if is_lost(duel) else "✔ ") + cost_text(duel.seconds or duel.rays)
                                             for duel in every)])
    ours, header = chart.settings.ours, ("scene", "its samples", *(SHORT[name] for name in MEASURES))
    return [Table(f"{ours} over {label(key, ours)} at equal error, {cost_name(chart)}", header, rows[key])
            for key in sorted(rows, key=lambda key: (key != RIVAL, key[0] != DIRECT))]


def fixed(chart: Chart) -> Iterator[Table]:
    """Yield what every method needs to reach a fixed error on every scene."""
    for measure in MEASURES:
        reaches = {(scene.scene, (reach.role, reach.method)): reach for scene in chart.scenes for reach in scene.reaches
                   if reach.measure == measure}
        keys, error = dict.fromkeys(key for _, key in reaches), next(iter(reaches.values())).error
        header = ("method", *(scene.scene for scene in chart.scenes))
        yield Table(f"To reach {SHORT[measure]} of {error:g}, {cost_name(chart)}", header, [
            [label(key, chart.settings.ours), *(
                cost_text(reach.seconds, time_text) if (reach := reaches[scene.scene, key]).seconds
                else cost_text(reach.rays) for scene in chart.scenes)] for key in keys])


def noise(chart: Chart) -> Table:
    return Table("References", ("scene", "samples", "lenses", "with foreground", *(SHORT[name] for name in MEASURES)), [
        [scene.scene, str(scene.reference.samples), "all" if scene.reference.lenses is None
         else str(scene.reference.lenses), str(scene.reference.counted),
         *(f"{scene.reference.noise[name]:.2g}" for name in MEASURES)] for scene in chart.scenes])


def numbers(chart: Chart) -> Iterator[Table]:
    """Yield every cell with its times and errors: of the mean where there are several scenes, then of every scene."""
    tables: list[tuple[str, Sequence[Cell]]] = [(scene.scene, scene.cells) for scene in chart.scenes]
    if len(chart.scenes) > 1:
        tables.insert(0, (f"Mean of {len(chart.scenes)} scenes", mean_cells(chart.scenes)))
    for title, cells in tables:
        names = [name for name in (*MEASURES, *PARTS) if any(name in cell.errors for cell in cells)]
        header = ("method", "samples", "scale", "rays", "seconds", *(SHORT[name] for name in names))
        rows = []
        for cell in cells:
            errors = [f"{error.mean:.3g} ({error.low:.3g}–{error.high:.3g})"
                      + (f" ± {error.spread:.1g}" if error.spread else "")
                      for error in (cell.errors[name] for name in names)]
            rows.append([label(cell.key, chart.settings.ours), str(cell.samples), str(cell.scale), f"{cell.rays:g}",
                         number(cell.seconds.mean if cell.seconds else None, digits=2), *errors])
        yield Table(title, header, rows)

