"""Fig. 10(a) and (b): elemental images per call, and the share of foreground, against the second stage's time."""

from __future__ import annotations

import statistics
from pathlib import Path

from lfsr_core.bench.paper import quality, renders, timing, weights
from lfsr_core.bench.paper.cells import Cells
from lfsr_core.bench.paper.figure import COLORS, Figure, Results, axes, markdown, number, save
from lfsr_core.bench.paper.settings import Settings
from lfsr_core.bench.paper.verdict import Difference, mean_interval, overall, paired, say
from lfsr_core.reconstruct.second_stage import UpscaleOptions, panel_image

NETWORK = "paper"
CLAIM_STEP = "The number of elemental images per call, 8 to 208, changes the time of the second stage."
CLAIM_SHARE = "Foreground selection saves time, the more the smaller the foreground is."


def measure_step(settings: Settings, folder: Path) -> Results:
    """Time of the generator alone on one frame, for each step."""
    inputs = {"steps": list(settings.steps), "workload": list(settings.workload), "repeats": settings.repeats,
              "device": settings.device, "scale": settings.scale}

    def run() -> dict:
        network = weights.untrained(NETWORK, settings.scale)
        steps = {str(step): step for step in settings.steps}
        return timing.network_times(dict.fromkeys(steps, network), settings.workload, settings.repeats,
                                    settings.device, steps)

    cells = Cells(folder, "fig10a")
    return {**cells("steps", inputs, run), "workload": list(settings.workload), "load": cells.load}


def draw_step(results: Results, _output: Path, path: Path) -> None:
    """Milliseconds over the step, quartiles as bars."""
    sheet, grid = axes(5, 3)
    steps = sorted(results["seconds"], key=int)
    middle = [timing.median_ms(results["seconds"][step]) for step in steps]
    low, high = zip(*(_quartiles(results["seconds"][step]) for step in steps), strict=True)
    grid[0, 0].errorbar([int(step) for step in steps], middle, color=COLORS[0], marker="o", capsize=3,
                        yerr=[[m - q for m, q in zip(middle, low, strict=True)],
                              [q - m for m, q in zip(middle, high, strict=True)]])
    count, side = results["workload"]
    grid[0, 0].set(xlabel="elemental images per call", ylabel=f"ms for {count} of {side}×{side}", ylim=(0, None))
    save(sheet, path)


def table_step(results: Results) -> list[str]:
    """Median and quartiles of each step."""
    rows = [[step, number(timing.median_ms(times), digits=1), *(number(q, digits=1) for q in _quartiles(times))]
            for step, times in sorted(results["seconds"].items(), key=lambda item: int(item[0]))]
    return markdown(["step", "ms", "quartile 1", "quartile 3"], rows)


def line_step(results: Results) -> str:
    """Slowest against fastest step; both are chosen on every other run and compared on the rest."""
    seconds = results["seconds"]
    choosing = {step: statistics.median(times[::2]) for step, times in seconds.items()}
    fastest, slowest = (min(choosing, key=choosing.get), max(choosing, key=choosing.get))
    found = {"": paired(seconds[slowest][1::2], seconds[fastest][1::2])}
    ratio = timing.median_ms(seconds[slowest]) / timing.median_ms(seconds[fastest])
    statement = f"Step {slowest} takes longer than step {fastest}, {ratio:.2f} times"
    return f"{overall(found)} {say(statement, found, 's')} Engine {results['engine']}, {results['device']}."


def _quartiles(times: list[float]) -> tuple[float, float]:
    low, _, high = statistics.quantiles(times, n=4)
    return 1e3 * low, 1e3 * high


def measure_share(settings: Settings, folder: Path) -> Results:
    """The whole second stage with and without selection, for the first scene seen from several distances."""
    cells, scene = Cells(folder, "fig10b"), settings.scenes[0]
    rows = []
    for share in settings.moves:
        inputs = {"scene": scene.stem, "distance": share, "display": settings.timing_display.to_dict(),
                  "scale": settings.scale, "spp": settings.spp, "repeats": settings.repeats, "device": settings.device}
        rows.append(cells(f"{scene.stem}-{share:g}", inputs, lambda share=share: _at(settings, scene, share)))
    return {"rows": rows, "scene": scene.stem, "load": cells.load}


def _at(settings: Settings, scene: Path, share: float) -> dict:
    moved = renders.moved(settings, scene, share)
    folder = renders.low_resolution(settings, moved, settings.scale, settings.spp, display=settings.timing_display)
    return {"distance": share, "p": quality.foreground_share(folder),
            "seconds": selection_times(settings, folder, NETWORK)}


def selection_times(settings: Settings, folder: Path, name: str) -> dict[str, list[float]]:
    """Seconds of the second stage "with" and "without" foreground selection."""
    method = weights.untrained_method(settings, name, settings.scale)
    return timing.take_turns({"with": lambda: panel_image(folder, method),
                              "without": lambda: panel_image(folder, method, UpscaleOptions(selection=False))},
                             settings.repeats)


def saved(row: dict) -> Difference:
    """Seconds that selection saves."""
    return mean_interval(_saved_each(row))


def draw_share(results: Results, _output: Path, path: Path) -> None:
    """Milliseconds over the share of foreground."""
    sheet, grid = axes(5, 3)
    rows = sorted(results["rows"], key=lambda row: row["p"])
    for kind, color in zip(("with", "without"), COLORS, strict=False):
        grid[0, 0].plot([row["p"] for row in rows], [timing.median_ms(row["seconds"][kind]) for row in rows],
                        marker="o", color=color, label=f"{kind} selection")
    grid[0, 0].set(xlabel="share of foreground lenses", ylabel="second stage, ms", ylim=(0, None), xlim=(0, 1.02))
    grid[0, 0].legend(frameon=False)
    save(sheet, path)


def table_share(results: Results) -> list[str]:
    """Distance, share of foreground, both times."""
    rows = [[f"{row['distance']:g}", number(row["p"]),
             *(number(timing.median_ms(row["seconds"][kind]), digits=1) for kind in ("with", "without"))]
            for row in results["rows"]]
    return markdown(["distance", "p", "ms with selection", "ms without"], rows)


def line_share(results: Results) -> str:
    """Saved time at every share, and whether a smaller foreground saves more."""
    rows = sorted(results["rows"], key=lambda row: row["p"])
    found = {f"p = {row['p']:.2f}": saved(row) for row in rows}
    words = say("Selection saves time", found, "s")
    least, most = rows[0], rows[-1]
    if least["p"] == most["p"]:
        return f"{overall(found, {})} {words} Every distance has the same share, so nothing tells how it matters."
    order = {"": paired(_saved_each(least), _saved_each(most))}
    statement = f"It saves more at p = {least['p']:.2f} than at p = {most['p']:.2f}"
    return f"{overall(found, order)} {words} {say(statement, order, 's')}"


def _saved_each(row: dict) -> list[float]:
    return [a - b for a, b in zip(row["seconds"]["without"], row["seconds"]["with"], strict=True)]


STEP = Figure("fig10a", "Fig. 10(a): step", CLAIM_STEP, measure_step, draw_step, table_step, line_step)
SHARE = Figure("fig10b", "Fig. 10(b): share of foreground", CLAIM_SHARE, measure_share, draw_share, table_share,
               line_share)
