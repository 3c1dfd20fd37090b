"""Fig. 12(a): time against direct path tracing for scale factors and resolutions."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

from lfsr_core.bench import plots
from lfsr_core.bench.paper import quality, renders, weights
from lfsr_core.bench.paper.cells import Cells
from lfsr_core.bench.paper.figure import Figure
from lfsr_core.bench.paper.records import FrameTimes, Results
from lfsr_core.bench.paper.renders import Shot
from lfsr_core.bench.paper.settings import Settings
from lfsr_core.bench.paper.verdict import SINGLE_RUN, overall, sentence, single_runs
from lfsr_core.bench.tables import markdown_table, number
from lfsr_core.frames.frame import read_frame
from lfsr_core.reconstruct.networks import catalogue

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Sheet

NETWORK = "paper"
REALTIME, WIDTH_8K = 30, 7680
CLAIM = f"Two stages take less time than direct path tracing, and reach {REALTIME} frames per second at 8K."


@dataclasses.dataclass(frozen=True, kw_only=True)
class ScaleRow(FrameTimes):
    """One frame.

    Attributes
    ----------
    pixels: of the panel, horizontal and vertical.
    scale: factor, 1 for direct path tracing.
    """

    pixels: tuple[int, int]
    scale: int


@dataclasses.dataclass(frozen=True, kw_only=True)
class Scales(Results):
    """Frames of one scene.

    Attributes
    ----------
    rows: every resolution and scale.
    render_device: Cycles device.
    scene: its name.
    samples: per pixel.
    """

    rows: tuple[ScaleRow, ...]
    render_device: str
    scene: str = ""
    samples: int = 0

    @property
    def by_pixels(self) -> dict[tuple[int, int], list[ScaleRow]]:
        """Rows of each resolution, direct path tracing first."""
        sizes = dict.fromkeys(row.pixels for row in self.rows)
        return {pixels: sorted((row for row in self.rows if row.pixels == pixels), key=lambda row: row.scale)
                for pixels in sizes}


def measure(settings: Settings) -> Scales:
    """Render and second stage of the first scene, every resolution and scale; scale 1 is direct."""
    cells, scene, rows = Cells(settings.output, "fig12a"), settings.scenes[0], []
    displays = (renders.resolution(settings.timing_display, divisor) for divisor in settings.resolutions)
    for display in filter(None, displays):
        for scale in (1, *(s for s in display.scales() if s in catalogue.spec(NETWORK).scales)):
            inputs = {"scene": scene.stem, "display": display.to_dict(), "scale": scale, "spp": settings.spp,
                      "device": settings.device, "render_device": settings.render_device}
            shot = Shot(scene, scale, settings.spp, display)
            rows.append(cells.get(ScaleRow, f"{scene.stem}-{display.panel_pixels[1]}-s{scale}", inputs,
                                  lambda shot=shot: _one(settings, shot)))
    return Scales(rows=tuple(rows), scene=scene.stem, samples=settings.spp, render_device=settings.render_device,
                  load=cells.load)


def _one(settings: Settings, shot: Shot) -> ScaleRow:
    """For direct path tracing the second stage runs without an upscaler."""
    folder = renders.low_resolution(settings, shot)
    method = weights.untrained_method(settings, NETWORK if shot.scale > 1 else "none", shot.scale)
    return ScaleRow(pixels=shot.display.panel_pixels, scale=shot.scale, render=read_frame(folder).seconds["render"],
                    second_stage=quality.second_stage_seconds(settings, folder, method))


def draw(results: Scales, _output: Path) -> Sheet:
    """Seconds per frame over the scale factor, a line per resolution."""
    sheet, grid = plots.sheet(5.5, 3.2)
    for index, (pixels, rows) in enumerate(results.by_pixels.items()):
        grid[0, 0].plot([row.scale for row in rows], [row.total for row in rows], "o-", color=plots.COLORS[index],
                        label=f"{pixels[0]}×{pixels[1]}")
    grid[0, 0].set(xlabel="scale factor (1: direct path tracing)", ylabel="seconds per frame", yscale="log")
    grid[0, 0].set_xticks(sorted({row.scale for row in results.rows}))
    grid[0, 0].legend(frameon=False, fontsize=8)
    return sheet


def table(results: Scales) -> list[str]:
    """Both stages, the sum, and how many times faster than direct."""
    rows = [[f"{width}×{height}", row.scale if row.scale > 1 else "direct", number(row.render),
             number(row.second_stage), number(row.total), number(found[0].total / row.total, digits=1)]
            for (width, height), found in results.by_pixels.items() for row in found]
    return markdown_table(["resolution", "scale", "render, s", "second stage, s", "sum, s", "times as fast"], rows)


def line(results: Scales) -> str:
    """Direct minus two stages in every cell, and the frame rate."""
    found = {f"{pixels[1]} rows at s = {row.scale}": single_runs(direct.total, row.total)
             for pixels, (direct, *ours) in results.by_pixels.items() for row in ours}
    best = max((row for row in results.rows if row.scale > 1), key=lambda row: (row.pixels[0], -row.total))
    rate = 1 / best.total
    # The bound is for 8K; a smaller frame cannot tell.
    realtime = {"": single_runs(rate, REALTIME)} if best.pixels[0] >= WIDTH_8K else {}
    return (f"{overall(found, realtime)} {sentence('Two stages take less time', found, 's')} Renders were timed once: "
            f"less than {100 * SINGLE_RUN:.0f} % of difference does not count. "
            f"{sentence(f'Above {REALTIME} frames per second at 8K', realtime, 'frames per second')} "
            f"The fastest at {best.pixels[0]}×{best.pixels[1]} is s = {best.scale} with {rate:.3g} frames per second, "
            f"rendered on {results.render_device}, {100 * best.render / best.total:.0f} % of it the render.")


FIGURE = Figure("fig12a", "Fig. 12(a): scale factors and resolutions", CLAIM, Scales, measure, table, line, draw)
