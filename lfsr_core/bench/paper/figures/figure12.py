"""Fig. 12: time against direct path tracing for scale factors and resolutions, and what foreground selection saves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lfsr_core.bench.paper import quality, renders, timing, weights
from lfsr_core.bench.paper.cells import Cells
from lfsr_core.bench.paper.figure import COLORS, Figure, Results, axes, markdown, number, save
from lfsr_core.bench.paper.figures import figure10
from lfsr_core.bench.paper.settings import Settings
from lfsr_core.bench.paper.verdict import SINGLE_RUN, overall, say, single_runs
from lfsr_core.frames.frame import read_frame
from lfsr_core.reconstruct.networks import catalogue
from lfsr_core.reconstruct.second_stage import panel_image

NETWORK = "paper"
REALTIME, WIDTH_8K = 30, 7680
CLAIM_SCALE = f"Two stages take less time than direct path tracing, and reach {REALTIME} frames per second at 8K."
CLAIM_SELECTION = "Foreground selection saves time on every model."


def measure_scale(settings: Settings, folder: Path) -> Results:
    """Render and second stage of the first scene, every resolution and scale; scale 1 is direct."""
    cells, scene = Cells(folder, "fig12a"), settings.scenes[0]
    rows = []
    for divisor in settings.resolutions:
        display = renders.resolution(settings.timing_display, divisor)
        if display is None:
            continue
        for scale in (1, *(s for s in display.scales() if s in catalogue.spec(NETWORK).scales)):
            inputs = {"scene": scene.stem, "display": display.to_dict(), "scale": scale, "spp": settings.spp,
                      "device": settings.device, "render_device": settings.render_device}
            rows.append(cells(f"{scene.stem}-{display.panel_pixels[1]}-s{scale}", inputs,
                              lambda display=display, scale=scale: _one(settings, scene, display, scale)))
    return {"rows": rows, "scene": scene.stem, "samples": settings.spp, "render_device": settings.render_device,
            "load": cells.load}


def _one(settings: Settings, scene: Path, display: Any, scale: int) -> dict[str, Any]:
    folder = renders.low_resolution(settings, scene, scale, settings.spp, display=display)
    second = _second_stage_seconds(settings, folder, scale)
    return {"pixels": list(display.panel_pixels), "scale": scale, "render": read_frame(folder).seconds["render"],
            "second_stage": second}


def _second_stage_seconds(settings: Settings, folder: Path, scale: int) -> float:
    """Median; for direct path tracing the same stage without an upscaler."""
    method = weights.untrained_method(settings, NETWORK if scale > 1 else "none", scale)
    return timing.median_ms(timing.take_turns({"": lambda: panel_image(folder, method)},
                                              settings.repeats)[""]) / 1e3


def total(row: dict[str, Any]) -> float:
    """Seconds per frame."""
    return row["render"] + row["second_stage"]


def draw_scale(results: Results, _output: Path, path: Path) -> None:
    """Seconds per frame over the scale factor, a line per resolution."""
    sheet, grid = axes(5.5, 3.2)
    for index, pixels in enumerate(_resolutions(results)):
        rows = _of(results, pixels)
        grid[0, 0].plot([row["scale"] for row in rows], [total(row) for row in rows], "o-", color=COLORS[index],
                        label=f"{pixels[0]}×{pixels[1]}")
    grid[0, 0].set(xlabel="scale factor (1: direct path tracing)", ylabel="seconds per frame", yscale="log")
    grid[0, 0].set_xticks(sorted({row["scale"] for row in results["rows"]}))
    grid[0, 0].legend(frameon=False, fontsize=8)
    save(sheet, path)


def _resolutions(results: Results) -> list[tuple[int, int]]:
    return list(dict.fromkeys(tuple(row["pixels"]) for row in results["rows"]))


def _of(results: Results, pixels: tuple[int, int]) -> list[dict[str, Any]]:
    return sorted((row for row in results["rows"] if tuple(row["pixels"]) == pixels), key=lambda row: row["scale"])


def table_scale(results: Results) -> list[str]:
    """Both stages, the sum, and how many times faster than direct."""
    rows = []
    for pixels in _resolutions(results):
        direct, *ours = _of(results, pixels)
        for row in (direct, *ours):
            rows.append([f"{pixels[0]}×{pixels[1]}", row["scale"] if row["scale"] > 1 else "direct",
                         number(row["render"]), number(row["second_stage"]), number(total(row)),
                         number(total(direct) / total(row), digits=1)])
    return markdown(["resolution", "scale", "render, s", "second stage, s", "sum, s", "times as fast"], rows)


def line_scale(results: Results) -> str:
    """Direct minus two stages in every cell, and the frame rate."""
    found = {}
    for pixels in _resolutions(results):
        direct, *ours = _of(results, pixels)
        found |= {f"{pixels[1]} rows at s = {row['scale']}": single_runs(total(direct), total(row)) for row in ours}
    ours = [row for row in results["rows"] if row["scale"] > 1]
    best = max(ours, key=lambda row: (row["pixels"][0], -total(row)))
    rate = 1 / total(best)
    # The bound is for 8K; a smaller frame cannot tell.
    realtime = {"": single_runs(rate, REALTIME)} if best["pixels"][0] >= WIDTH_8K else {}
    return (f"{overall(found, realtime)} {say('Two stages take less time', found, 's')} Renders were timed once: "
            f"less than {100 * SINGLE_RUN:.0f} % of difference does not count. "
            f"{say(f'Above {REALTIME} frames per second at 8K', realtime, 'frames per second')} "
            f"The fastest at {best['pixels'][0]}×{best['pixels'][1]} is s = {best['scale']} with {rate:.3g} frames per "
            f"second, rendered on {results['render_device']}, {share_of_render(best):.0f} % of it the render.")


def share_of_render(row: dict[str, Any]) -> float:
    """Per cent of a frame's time that the render takes."""
    return 100 * row["render"] / total(row)


def measure_selection(settings: Settings, folder: Path) -> Results:
    """The second stage of every scene with and without selection."""
    cells, rows = Cells(folder, "fig12b"), []
    for scene in settings.scenes:
        inputs = {"scene": scene.stem, "display": settings.timing_display.to_dict(), "scale": settings.scale,
                  "spp": settings.spp, "repeats": settings.repeats, "device": settings.device}
        rows.append(cells(scene.stem, inputs, lambda scene=scene: _selection(settings, scene)))
    return {"rows": rows, "load": cells.load}


def _selection(settings: Settings, scene: Path) -> dict[str, Any]:
    folder = renders.low_resolution(settings, scene, settings.scale, settings.spp, display=settings.timing_display)
    return {"scene": scene.stem, "p": quality.foreground_share(folder),
            "render": read_frame(folder).seconds["render"],
            "seconds": figure10.selection_times(settings, folder, NETWORK)}


def draw_selection(results: Results, _output: Path, path: Path) -> None:
    """Two bars per scene."""
    sheet, grid = axes(6, 3)
    names = [f"{row['scene']}\np = {row['p']:.2f}" for row in results["rows"]]
    for index, kind in enumerate(("with", "without")):
        grid[0, 0].bar([place + 0.4 * index - 0.2 for place in range(len(names))],
                       [timing.median_ms(row["seconds"][kind]) for row in results["rows"]], 0.38, color=COLORS[index],
                       label=f"{kind} selection")
    grid[0, 0].set_xticks(range(len(names)), names, fontsize=7)
    grid[0, 0].set_ylabel("second stage, ms")
    grid[0, 0].margins(y=0.25)
    grid[0, 0].legend(frameon=False, fontsize=8, loc="upper left", ncols=2)
    save(sheet, path)


def table_selection(results: Results) -> list[str]:
    """Times of every scene."""
    rows = [[row["scene"], number(row["p"]), number(row["render"]),
             *(number(timing.median_ms(row["seconds"][kind]), digits=1) for kind in ("with", "without"))]
            for row in results["rows"]]
    return markdown(["scene", "p", "render, s", "ms with selection", "ms without"], rows)


def line_selection(results: Results) -> str:
    """Saved time per scene, also as a share of the frame."""
    found = {row["scene"]: figure10.saved(row) for row in results["rows"]}
    shares = [100 * figure10.saved(row).value / (row["render"] + timing.median_ms(row["seconds"]["without"]) / 1e3)
              for row in results["rows"]]
    return (f"{overall(found)} {say('Selection saves time', found, 's')} That is {min(shares):.1f} to "
            f"{max(shares):.1f} % of a whole frame with its render.")


SCALE = Figure("fig12a", "Fig. 12(a): scale factors and resolutions", CLAIM_SCALE, measure_scale, draw_scale,
               table_scale, line_scale)
SELECTION = Figure("fig12b", "Fig. 12(b): foreground selection", CLAIM_SELECTION, measure_selection, draw_selection,
                   table_selection, line_selection)
