"""Fig. 10(c) and (d): how many convolutions, and which architecture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lfsr_core.bench.paper import quality, renders, timing, weights
from lfsr_core.bench.paper.cells import Cells
from lfsr_core.bench.paper.figure import (
    COLORS,
    Figure,
    Results,
    axes,
    by_name,
    gains,
    markdown,
    metric,
    missing,
    number,
    save,
    unequal,
)
from lfsr_core.bench.paper.settings import Settings
from lfsr_core.bench.paper.verdict import Difference, overall, paired, say, span

DEPTHS = {"paper": 2, **{f"paper-{n}": n for n in (3, 4, 5, 6)}}
ARCHITECTURES = ("paper", "espcn", "fsrcnn")
STEP = 48
WORTH = 0.01  # split SSIM that a deeper network would have to add
CLAIM_DEPTH = "Two convolutions suffice: more cost time and add little."
CLAIM_ARCHITECTURE = ("Its words are not known here; taken as: no other light network is both faster and more "
                      "accurate than the generator.")


def measure_depth(settings: Settings, folder: Path) -> Results:
    """Time and accuracy of the generator with two to six convolutions."""
    return _measure(settings, Cells(folder, "fig10c"), tuple(DEPTHS))


def measure_architecture(settings: Settings, folder: Path) -> Results:
    """Time and accuracy of the generator, ESPCN and FSRCNN, and of bicubic for comparison of accuracy."""
    return _measure(settings, Cells(folder, "fig10d"), ARCHITECTURES, ("bicubic",))


def _measure(settings: Settings, cells: Cells, names: Sequence[str], only_quality: Sequence[str] = ()) -> Results:
    inputs = {"networks": list(names), "workload": list(settings.workload), "repeats": settings.repeats,
              "device": settings.device, "scale": settings.scale, "step": STEP}
    times = cells("times", inputs, lambda: _times(settings, names))
    rows = [_row(settings, cells, scene, name) for scene in settings.scenes for name in (*names, *only_quality)]
    return {"times": times, "rows": rows, "workload": list(settings.workload), "samples": settings.clean_spp,
            "load": cells.load, "schedules": quality.schedules(settings, names)}


def _times(settings: Settings, names: Sequence[str]) -> dict[str, Any]:
    networks = {name: weights.untrained(name, settings.scale) for name in names}
    return timing.network_times(networks, settings.workload, settings.repeats, settings.device,
                                dict.fromkeys(names, STEP))


def _row(settings: Settings, cells: Cells, scene: Path, name: str) -> dict[str, Any]:
    """Accuracy on a render nearly without noise: what a network adds there is its own."""
    def run() -> dict[str, Any] | None:
        folder = renders.low_resolution(settings, scene, settings.scale, settings.clean_spp)
        return quality.measure(settings, scene, folder, name)

    inputs = quality.inputs(settings, scene, name, spp=settings.clean_spp)
    return {"scene": scene.stem, "method": name, **(cells(f"{scene.stem}-{name}", inputs, run) or {})}


def draw(results: Results, _output: Path, path: Path) -> None:
    """Time as bars, accuracy of every scene as points."""
    names = list(results["times"]["seconds"])
    sheet, grid = axes(8, 3, 1, 2)
    grid[0, 0].bar(names, [timing.median_ms(results["times"]["seconds"][name]) for name in names], color=COLORS[0])
    count, side = results["workload"]
    grid[0, 0].set_ylabel(f"ms for {count} of {side}×{side}")
    found = by_name(results["rows"], "scene", "method")
    methods = list(dict.fromkeys(row["method"] for row in results["rows"]))
    for index, scene in enumerate(dict.fromkeys(scene for scene, _ in found)):
        shown = [name for name in methods if (scene, name) in found]
        values = [found[scene, name]["metrics"]["ssim_eia_fg"] for name in shown]
        grid[0, 1].plot([methods.index(name) for name in shown], values, "o-", ms=4, lw=0.8,
                        color=COLORS[index % len(COLORS)], label=scene)
    grid[0, 1].set_xticks(range(len(methods)), methods)
    grid[0, 1].set_ylabel("split SSIM, foreground")
    if found:
        grid[0, 1].legend(frameon=False, fontsize=7)
    for axis in grid[0]:
        axis.tick_params(axis="x", rotation=20, labelsize=8)
    save(sheet, path)


def table(results: Results) -> list[str]:
    """Time per network, accuracy per scene."""
    scenes = list(dict.fromkeys(row["scene"] for row in results["rows"]))
    found = by_name(results["rows"], "scene", "method")
    rows = []
    for name in dict.fromkeys(row["method"] for row in results["rows"]):
        times = results["times"]["seconds"].get(name)
        quality_cells = [metric(found[scene, name], "ssim_eia_fg", 4) if (scene, name) in found else "–"
                         for scene in scenes]
        rows.append([name, number(timing.median_ms(times), digits=1) if times else "–", *quality_cells])
    return markdown(["network", "ms", *scenes], rows)


def line_depth(results: Results) -> str:
    """What the deeper ones add to time and accuracy."""
    seconds = results["times"]["seconds"]
    slower = {name: paired(seconds[name], seconds["paper"]) for name in DEPTHS if name != "paper"}
    ratio = timing.median_ms(seconds["paper-6"]) / timing.median_ms(seconds["paper"])
    words = f"{say('More convolutions cost time', slower, 's')} Six take {ratio:.2f} times as long as two."
    short = {f"{name} on {scene}": gain for name in slower
             for scene, gain in gains(results["rows"], name, "paper").items()}
    # Above zero where even the upper end of what is gained stays below WORTH.
    room = {name: Difference(WORTH - gain.value, gain.half) for name, gain in short.items()}
    added = f" They add {span(short)} of split SSIM." if short else ""
    little = say(f"They add less than {WORTH} of split SSIM", room, "to spare")
    return (f"{overall(slower, room)} {words} {little}{added}"
            + missing(results["rows"]) + unequal(results["schedules"]))


def line_architecture(results: Results) -> str:
    """Whether any rival is both faster and more accurate than the generator."""
    seconds = results["times"]["seconds"]
    words, unbeaten = [], {}
    for name in ARCHITECTURES[1:]:
        faster = {"": paired(seconds["paper"], seconds[name])}
        better = gains(results["rows"], name, "paper")
        ratio = timing.median_ms(seconds[name]) / timing.median_ms(seconds["paper"])
        words.append(say(f"{name} is faster than the generator ({ratio:.2f} times its time)", faster, "s"))
        words.append(say(f"{name} is more accurate", better, "split SSIM"))
        unbeaten |= {f"{name} on {scene}": worst(faster[""], gain) for scene, gain in better.items()}
    over = gains(results["rows"], "paper", "bicubic")
    words.append(say("The generator is more accurate than bicubic", over, "split SSIM"))
    return " ".join([overall(unbeaten), *words]) + missing(results["rows"]) + unequal(results["schedules"])


def worst(faster: Difference, better: Difference) -> Difference:
    """Above zero where a rival surely lacks one of both, below where it surely has both."""
    return Difference(-min(faster.sign, better.sign), 0.0)


DEPTH = Figure("fig10c", "Fig. 10(c): number of convolutions", CLAIM_DEPTH, measure_depth, draw, table, line_depth)
ARCHITECTURE = Figure("fig10d", "Fig. 10(d): architectures", CLAIM_ARCHITECTURE, measure_architecture, draw, table,
                      line_architecture)
