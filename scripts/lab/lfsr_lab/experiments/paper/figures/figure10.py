"""Fig. 10(a), (c) and (d): elemental images per call, number of convolutions and architecture of a network."""

from __future__ import annotations

import dataclasses
import statistics
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lfsr_lab.experiments.engine import plots, timing
from lfsr_lab.experiments.engine.report import markdown_table, number
from lfsr_lab.experiments.paper import quality, weights
from lfsr_lab.experiments.paper.figure import Figure, cautions, gains, main_metric, measured, metric, scenes_of
from lfsr_lab.experiments.paper.records import NetworkTimes, Results, Row, Rows
from lfsr_lab.experiments.paper.renders import View
from lfsr_lab.experiments.paper.settings import Settings
from lfsr_lab.experiments.paper.verdict import Difference, overall, paired, sentence, span

NETWORK = "paper"
DEPTHS = {"paper": 2, **{f"paper-{n}": n for n in (3, 4, 5, 6)}}
ARCHITECTURES = ("paper", "espcn", "fsrcnn")
STEP = 48
WORTH = 0.01  # split SSIM that a deeper network would have to add
CLAIM_STEP = "The number of elemental images per call, 8 to 208, changes the time of the second stage."
CLAIM_DEPTH = "Two convolutions suffice: more cost time and add little."
CLAIM_ARCHITECTURE = ("Its words are not known here; taken as: no other light network is both faster and more "
                      "accurate than the generator.")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Steps(Results, NetworkTimes):
    """Times of one network for each number of elemental images per call, the names of ``seconds``."""

    workload: tuple[int, int] = (0, 0)  # elemental images per frame and their low-resolution side


@dataclasses.dataclass(frozen=True, kw_only=True)
class Networks(Rows):
    """Time and accuracy of several networks."""

    times: NetworkTimes  # of the networks alone
    workload: tuple[int, int] = (0, 0)  # elemental images per frame and their low-resolution side

    def median_ms(self, name: str) -> float:
        """Median time of a network in milliseconds."""
        return timing.median_ms(self.times.seconds[name])

    def ratio(self, name: str) -> float:
        """How many times as long as the generator a network takes."""
        return self.median_ms(name) / self.median_ms(NETWORK)


def measure_step(settings: Settings) -> Steps:
    """Time of the generator alone on one frame, for each step."""
    inputs = {"steps": list(settings.steps), "workload": list(settings.workload), "repeats": settings.repeats,
              "device": settings.device, "scale": settings.scale}

    def run() -> NetworkTimes:
        steps = {str(step): step for step in settings.steps}
        return quality.network_times(settings, dict.fromkeys(steps, weights.untrained(NETWORK, settings.scale)), steps)

    records = quality.records_of(settings, "fig10a", NetworkTimes)
    return Steps(**vars(quality.measure_once(records, "steps", inputs, run)), workload=settings.workload,
                 load=records.load)


def draw_step(results: Steps, _output: Path) -> plots.Figure:
    """Draw milliseconds over the step, quartiles as bars."""
    sheet, grid = plots.sheet(5, 3)
    steps = sorted(results.seconds, key=int)
    low, middle, high = np.transpose([_quartiles(results.seconds[step]) for step in steps])
    grid[0, 0].errorbar([*map(int, steps)], middle, (middle - low, high - middle), color=plots.COLORS[0], marker="o",
                        capsize=3)
    grid[0, 0].set(xlabel="elemental images per call", ylabel=_workload(results), ylim=(0, None))
    return sheet


def table_step(results: Steps) -> list[str]:
    """Return a table of median and quartiles of each step."""
    found = {step: _quartiles(results.seconds[step]) for step in sorted(results.seconds, key=int)}
    rows = [[step, *(number(ms, digits=1) for ms in (middle, low, high))]
            for step, (low, middle, high) in found.items()]
    return markdown_table(["step", "ms", "quartile 1", "quartile 3"], rows)


def line_step(results: Steps) -> str:
    """Return sentences on slowest against fastest step; both are chosen on every other run and compared on the rest."""
    seconds = results.seconds
    choosing = {step: statistics.median(times[::2]) for step, times in seconds.items()}
    fastest, slowest = min(choosing, key=choosing.__getitem__), max(choosing, key=choosing.__getitem__)
    found = {"": paired(seconds[slowest][1::2], seconds[fastest][1::2])}
    ratio = timing.median_ms(seconds[slowest]) / timing.median_ms(seconds[fastest])
    statement = f"Step {slowest} takes longer than step {fastest}, {ratio:.2f} times"
    return f"{overall(found)} {sentence(statement, found, 's')} Engine {results.engine}, {results.device}."


def _quartiles(times: Sequence[float]) -> list[float]:
    """First quartile, median and third quartile in milliseconds."""
    return [1e3 * seconds for seconds in statistics.quantiles(times, n=4)]


def _workload(results: Steps | Networks) -> str:
    count, side = results.workload
    return f"ms for {count} of {side}×{side}"


def measure_depth(settings: Settings) -> Networks:
    """Time and accuracy of the generator with two to six convolutions."""
    return _measure(settings, "fig10c", tuple(DEPTHS))


def measure_architecture(settings: Settings) -> Networks:
    """Time and accuracy of the generator, ESPCN and FSRCNN, and of bicubic for comparison of accuracy."""
    return _measure(settings, "fig10d", ARCHITECTURES, ("bicubic",))


def _measure(settings: Settings, figure: str, names: Sequence[str], only_quality: Sequence[str] = ()) -> Networks:
    """Measure networks; accuracy on a render nearly without noise, so that only the network matters."""
    inputs = {"networks": list(names), "workload": list(settings.workload), "repeats": settings.repeats,
              "device": settings.device, "scale": settings.scale, "step": STEP}
    timed, records = quality.records_of(settings, figure, NetworkTimes), quality.records_of(settings, figure, Row)
    times = quality.measure_once(timed, "times", inputs, lambda: quality.network_times(
        settings, {name: weights.untrained(name, settings.scale) for name in names}, dict.fromkeys(names, STEP)))
    views = [View(scene, settings.scale, settings.clean_spp) for scene in settings.scenes]
    rows = tuple(quality.row(settings, records, view, name, f"{view.scene.stem}-{name}", quality.accuracy)
                 for view in views for name in (*names, *only_quality))
    return Networks(times=times, rows=rows, workload=settings.workload, samples=(settings.clean_spp,),
                    load=records.load, schedules=quality.schedules(settings, names))


def draw(results: Networks, _output: Path) -> plots.Figure:
    """Draw time as bars, accuracy of every scene as points."""
    names = list(results.times.seconds)
    sheet, grid = plots.sheet(8, 3, 1, 2)
    times, accuracy = grid[0]
    times.bar(names, [results.median_ms(name) for name in names], color=plots.COLORS[0])
    times.set_ylabel(_workload(results))
    found = measured(results.rows)
    methods = list(dict.fromkeys(row.method for row in results.rows))
    for index, scene in enumerate(scenes_of(found.values())):
        places = [(place, found[scene, name].metrics[main_metric(results.rows)]) for place, name in enumerate(methods)
                  if (scene, name) in found]
        accuracy.plot(*zip(*places, strict=True), "o-", ms=4, lw=0.8, label=scene,
                      color=plots.COLORS[index % len(plots.COLORS)])
    accuracy.set_xticks(range(len(methods)), methods)
    accuracy.set_ylabel(f"split SSIM, foreground ({main_metric(results.rows)})")
    if found:
        accuracy.legend(frameon=False, fontsize=7)
    for axis in grid[0]:
        axis.tick_params(axis="x", rotation=20, labelsize=8)
    return sheet


def table(results: Networks) -> list[str]:
    """Return a table of time per network, accuracy per scene."""
    scenes, found = scenes_of(results.rows), measured(results.rows)
    rows = []
    for name in dict.fromkeys(row.method for row in results.rows):
        ms = results.median_ms(name) if name in results.times.seconds else None
        accuracies = [metric(found[scene, name], main_metric(results.rows), 4) if (scene, name) in found else None
                      for scene in scenes]
        rows.append([name, number(ms, digits=1), *accuracies])
    return markdown_table(["network", "ms", *scenes], rows)


def line_depth(results: Networks) -> str:
    """Return sentences on what the deeper ones add to time and accuracy."""
    seconds = results.times.seconds
    slower = {name: paired(seconds[name], seconds[NETWORK]) for name in DEPTHS if name != NETWORK}
    words = sentence("More convolutions cost time", slower, "s")
    added = {f"{name} on {scene}": gain for name in slower
             for scene, gain in gains(results.rows, name, NETWORK).items()}
    # Above zero where even the upper end of what is gained stays below WORTH.
    room = {name: Difference(WORTH - gain.value, gain.half) for name, gain in added.items()}
    little = sentence(f"They add less than {WORTH} of split SSIM", room, "to spare")
    little += f" They add {span(added)} of split SSIM." if added else ""
    return (f"{overall(slower, room)} {words} Six take {results.ratio('paper-6'):.2f} times as long as two. {little}"
            + cautions(results.rows, results.schedules))


def line_architecture(results: Networks) -> str:
    """Return sentences on whether any rival is both faster and more accurate than the generator."""
    seconds = results.times.seconds
    words: list[str] = []
    unbeaten: dict[str, Difference] = {}
    for name in ARCHITECTURES[1:]:
        faster, better = {"": paired(seconds[NETWORK], seconds[name])}, gains(results.rows, name, NETWORK)
        statement = f"{name} is faster than the generator ({results.ratio(name):.2f} times its time)"
        words += [sentence(statement, faster, "s"), sentence(f"{name} is more accurate", better, "split SSIM")]
        unbeaten |= {f"{name} on {scene}": worst(faster[""], gain) for scene, gain in better.items()}
    over = gains(results.rows, NETWORK, "bicubic")
    words.append(sentence("The generator is more accurate than bicubic", over, "split SSIM"))
    return " ".join([overall(unbeaten), *words]) + cautions(results.rows, results.schedules)


def worst(faster: Difference, better: Difference) -> Difference:
    """Return a difference above zero where a rival is slower or less accurate, below where it is better in both."""
    return Difference(-min(faster.sign, better.sign), 0.0)


STEPS = Figure("fig10a", "Fig. 10(a): step", CLAIM_STEP, Steps, measure_step, table_step, line_step, draw_step)
DEPTH = Figure("fig10c", "Fig. 10(c): number of convolutions", CLAIM_DEPTH, Networks, measure_depth, table, line_depth,
               draw)
ARCHITECTURE = Figure("fig10d", "Fig. 10(d): architectures", CLAIM_ARCHITECTURE, Networks, measure_architecture, table,
                      line_architecture, draw)
