"""Fig. 10(a), (c), (d) and Table 3: images per call, convolutions, architecture and multiply-adds of networks."""

from __future__ import annotations

import functools
import statistics
from collections.abc import Iterator, Sequence
from pathlib import Path

from lfsr_lab.experiments.engine import plots
from lfsr_lab.experiments.engine.records import Cell
from lfsr_lab.experiments.seed_paper import figure as fig
from lfsr_lab.experiments.seed_paper import measuring
from lfsr_lab.networks import comparators

NETWORK, BICUBIC = "paper", "bicubic"
DEEPER, RIVALS = ("paper-3", "paper-4", "paper-5", "paper-6"), ("espcn", "fsrcnn")
BY_DEPTH, BY_ARCHITECTURE = (NETWORK, *DEEPER), (NETWORK, *RIVALS)
STEP = 48
WORTH = 0.01  # split SSIM that a deeper network would have to add
CLAIM_STEP = "The number of elemental images per call, 8 to 208, changes the time of the second stage."
CLAIM_DEPTH = "Two convolutions suffice: more cost time and add little."
CLAIM_ARCHITECTURE = ("Its words are not known here; taken as: no other light network is both faster and more "
                      "accurate than the generator.")
CLAIM_COST = "The generator needs fewer multiply-adds than other networks for super-resolution."
COLUMNS = ("ms", measuring.ACCURACY)
PER_PIXEL, PER_FRAME = "multiply-adds per low-resolution pixel", "10⁹ per frame, all lenses"


def network_cells(figure: str, names: Sequence[str], untimed: Sequence[str],
                  settings: measuring.Settings) -> Iterator[Cell[measuring.Rows]]:
    """Yield times, and accuracy of a render nearly without noise: what a network adds there is its own."""
    yield measuring.network_times(settings, {name: (name, STEP) for name in names})
    for scene in settings.scenes:
        for name in (*names, *untimed):
            view = measuring.View(scene, settings.clean_spp)
            yield measuring.accuracy_cell(settings, figure, view, name, measuring.accuracy)


def draw_step(rows: Sequence[measuring.Row], _folder: Path) -> plots.Figure:
    """Draw milliseconds over the step, quartiles as bars."""
    sheet, grid = plots.sheet(5, 3)
    bars = [[abs(row.value(name) - row.value("ms")) for row in rows] for name in measuring.TIME_COLUMNS[1:]]
    grid[0, 0].errorbar([int(row.method) for row in rows], [row.value("ms") for row in rows], bars,
                        color=plots.COLORS[0], marker="o", capsize=3)
    grid[0, 0].set(xlabel="elemental images per call", ylabel=f"ms for {rows[0].how}", ylim=(0, None))
    return sheet


def draw_networks(rows: Sequence[measuring.Row], _folder: Path) -> plots.Figure:
    """Draw time as bars, accuracy of every scene as points."""
    sheet, grid = plots.sheet(8, 3, 1, 2)
    times, accuracies = grid[0]
    timed = [row for row in rows if row.series.get(measuring.SECONDS)]
    times.bar([row.method for row in timed], [row.value("ms") for row in timed], color=plots.COLORS[0])
    times.set_ylabel(f"ms for {timed[0].how}", fontsize=8)
    for index, scene in enumerate(fig.scenes_of(rows)):
        shown = [row for row in rows if row.scene == scene and row.values]
        accuracies.plot([row.method for row in shown], [row.value(measuring.ACCURACY) for row in shown], "o-", ms=4,
                        lw=0.8, label=scene, color=plots.COLORS[index % len(plots.COLORS)])
    accuracies.set_ylabel(f"split SSIM ({measuring.ACCURACY})", fontsize=8)
    accuracies.legend(frameon=False, fontsize=7)
    for axis in grid[0]:
        axis.tick_params(axis="x", rotation=20, labelsize=8)
    return sheet


def rule_step(rows: Sequence[measuring.Row]) -> str:
    """Return slowest against fastest step; both are chosen on every other run and compared on the rest."""
    order = sorted(rows, key=lambda row: statistics.median(row.series[measuring.SECONDS][::2]))
    fastest, slowest = order[0], order[-1]
    slower = {"": fig.paired(slowest.series[measuring.SECONDS][1::2], fastest.series[measuring.SECONDS][1::2])}
    ratio = slowest.value("ms") / fastest.value("ms")
    statement = f"Step {slowest.method} takes longer than step {fastest.method}, {ratio:.2f} times"
    return f"{fig.overall(slower)} {fig.sentence(statement, slower, 's')}"


def rule_depth(rows: Sequence[measuring.Row]) -> str:
    """Return what the deeper networks add to time and accuracy."""
    slower = {name: fig.gains(rows, name, NETWORK, measuring.SECONDS)[""] for name in DEEPER}
    added = {f"{name} on {scene}": gain for name in DEEPER for scene, gain in fig.gains(rows, name, NETWORK).items()}
    # Above zero where even the upper end of what is gained stays below WORTH.
    room = {name: fig.Difference(WORTH - gain.value, gain.half) for name, gain in added.items()}
    little = fig.sentence(f"They add less than {WORTH} of split SSIM", room, "to spare")
    little += f" They add {fig.span(added)} of split SSIM." if added else ""
    return (f"{fig.overall(slower, room)} {fig.sentence('More convolutions cost time', slower, 's')} Six take "
            f"{_ratio(rows, DEEPER[-1]):.2f} times as long as two. {little}")


def rule_architecture(rows: Sequence[measuring.Row]) -> str:
    """Return whether any rival is both faster and more accurate than the generator."""
    words: list[str] = []
    unbeaten: dict[str, fig.Difference] = {}
    for name in RIVALS:
        faster, better = fig.gains(rows, NETWORK, name, measuring.SECONDS), fig.gains(rows, name, NETWORK)
        statement = f"{name} is faster than the generator ({_ratio(rows, name):.2f} times its time)"
        words += [fig.sentence(statement, faster, "s"), fig.sentence(f"{name} is more accurate", better, "split SSIM")]
        unbeaten |= {f"{name} on {scene}": worst(faster[""], gain) for scene, gain in better.items()}
    above = fig.gains(rows, NETWORK, BICUBIC)
    words.append(fig.sentence("The generator is more accurate than bicubic", above, "split SSIM"))
    return " ".join([fig.overall(unbeaten), *words])


def worst(faster: fig.Difference, better: fig.Difference) -> fig.Difference:
    """Return what is above zero where a rival surely lacks one of both, below where it surely has both."""
    return fig.Difference(-min(faster.sign, better.sign))


def _ratio(rows: Sequence[measuring.Row], name: str) -> float:
    """Return how many times as long as the generator a network takes."""
    ms = {row.method: row.value("ms") for row in rows if row.series.get(measuring.SECONDS)}
    return ms[name] / ms[NETWORK]


def cost_cells(settings: measuring.Settings) -> Iterator[Cell[measuring.Rows]]:
    """Yield the costs of all networks, which are counted, not timed."""
    display = settings.timing_display
    width, height = display.eia_pixels

    def count() -> measuring.Rows:
        from lfsr_lab.networks.networks import multiply_adds, parameters

        rows = []
        for name, entry in comparators.NETWORKS.items():
            # Only what works on an elemental image of its own; the adversary leaves the generator's size as it is.
            if not entry.whole and name != "paper-gan":
                network = measuring.untrained(name, measuring.SCALE)
                per_pixel = multiply_adds(network, *display.low_views(measuring.SCALE)[::-1])
                rows.append(measuring.Row(method=name, values={"parameters": parameters(network), PER_PIXEL: per_pixel,
                                                     PER_FRAME: per_pixel * width * height / measuring.SCALE**2 / 1e9}))
        return measuring.Rows(tuple(rows))

    yield Cell("costs", {"display": display.to_dict(), "networks": sorted(comparators.NETWORKS)}, count)


def rule_cost(rows: Sequence[measuring.Row]) -> str:
    """Return the generator against the other architectures."""
    cost = {row.method: row.value(PER_PIXEL) for row in rows}
    others = {name: fig.Difference(value / cost["paper"] - 1) for name, value in cost.items()
              if not name.startswith("paper")}
    ratios = ", ".join(f"{name} {1 + other.value:.2f}" for name, other in others.items())
    return f"{fig.overall(others)} Times the generator's: {ratios} (counted, so without an interval)."


STEPS = fig.Figure("fig10a", "Fig. 10(a): step", CLAIM_STEP, lambda settings: [
    measuring.network_times(settings, {str(step): (NETWORK, step) for step in settings.steps})],
    measuring.TIME_COLUMNS, rule_step, draw_step)
DEPTH = fig.Figure("fig10c", "Fig. 10(c): number of convolutions", CLAIM_DEPTH,
               functools.partial(network_cells, "fig10c", BY_DEPTH, ()), COLUMNS, rule_depth, draw_networks, BY_DEPTH)
ARCHITECTURE = fig.Figure("fig10d", "Fig. 10(d): architectures", CLAIM_ARCHITECTURE,
                      functools.partial(network_cells, "fig10d", BY_ARCHITECTURE, (BICUBIC,)), COLUMNS,
                      rule_architecture, draw_networks, BY_ARCHITECTURE)
COST = fig.Figure("table3", "Table 3: multiply-adds", CLAIM_COST, cost_cells, ("parameters", PER_PIXEL, PER_FRAME),
              rule_cost)
