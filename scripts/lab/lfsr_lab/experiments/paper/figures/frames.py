"""Fig. 10(b), 12(a) and 12(b): times of whole frames, and what foreground selection saves."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from pathlib import Path

from lfsr_core.frames.frame import read_frame
from lfsr_core.reconstruct.networks import catalogue
from lfsr_core.reconstruct.options import UpscaleOptions
from lfsr_core.reconstruct.second_stage import panel_image
from lfsr_lab.experiments.engine import plots, timing
from lfsr_lab.experiments.engine.records import Records
from lfsr_lab.experiments.engine.renders import foreground
from lfsr_lab.experiments.engine.report import markdown_table, number
from lfsr_lab.experiments.engine.timing import Seconds
from lfsr_lab.experiments.paper import quality, renders, weights
from lfsr_lab.experiments.paper.figure import Figure
from lfsr_lab.experiments.paper.records import Results, Row
from lfsr_lab.experiments.paper.renders import View
from lfsr_lab.experiments.paper.settings import Settings
from lfsr_lab.experiments.paper.verdict import (
    SINGLE_RUN,
    Difference,
    mean_interval,
    overall,
    paired,
    sentence,
    single_runs,
)

NETWORK = "paper"
KINDS = ("with", "without")
REALTIME, WIDTH_8K = 30, 7680
CLAIM_SHARE = "Foreground selection saves time, the more the smaller the foreground is."
CLAIM_SCENES = "Foreground selection saves time on every model."
CLAIM_SCALE = f"Two stages take less time than direct path tracing, and reach {REALTIME} frames per second at 8K."


@dataclasses.dataclass(frozen=True, kw_only=True)
class Selection:
    """The second stage of one frame with and without foreground selection."""

    p: float  # fraction of foreground lenses
    seconds: Seconds  # of every run "with" and "without"
    distance: float | None = None  # of the camera array in Fig. 10(b), as a fraction of its own
    scene: str = ""  # its name
    render: float = 0.0  # seconds of the first stage

    @property
    def saved_each(self) -> list[float]:
        """Seconds that selection saves in each pair of runs."""
        return [a - b for a, b in zip(self.seconds["without"], self.seconds["with"], strict=True)]

    @property
    def saved(self) -> Difference:
        """Their mean."""
        return mean_interval(self.saved_each)

    @property
    def medians(self) -> list[float]:
        """Milliseconds with and without."""
        return [timing.median_ms(self.seconds[kind]) for kind in KINDS]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Selections(Results):
    """Foreground selection seen from several distances, or for several scenes."""

    rows: tuple[Selection, ...]  # one of each
    scene: str = ""  # name of the one scene

    @property
    def by_share(self) -> list[Selection]:
        """Rows from the smallest foreground to the largest."""
        return sorted(self.rows, key=lambda row: row.p)


def measure_share(settings: Settings) -> Selections:
    """Measure the second stage with and without selection, for the first scene seen from several distances."""
    return _selections(settings, "fig10b", [(settings.scenes[0], distance) for distance in settings.moves])


def measure_scenes(settings: Settings) -> Selections:
    """Measure the second stage of every scene with and without selection."""
    return _selections(settings, "fig12b", [(scene, None) for scene in settings.scenes])


def _selections(settings: Settings, figure: str, seen: Sequence[tuple[Path, float | None]]) -> Selections:
    records = quality.records_of(settings, figure, Selection)
    rows = tuple(_selection(settings, records, scene, distance) for scene, distance in seen)
    return Selections(rows=rows, scene=seen[0][0].stem, load=records.load)


def _selection(of: Settings, cells: Records[Selection], scene: Path, distance: float | None) -> Selection:
    """Measure the scene as it is, or from another distance."""
    inputs = {"scene": scene.stem, "display": of.timing_display.to_dict(), "scale": of.scale, "spp": of.spp,
              "repeats": of.repeats, "device": of.device} | ({} if distance is None else {"distance": distance})

    def measure() -> Selection:
        seen = scene if distance is None else renders.moved(of, scene, distance)
        folder = renders.low_resolution(of, View(seen, of.scale, of.spp, of.timing_display))
        method = weights.untrained_method(of, NETWORK, of.scale)
        runs = {"with": lambda: panel_image(folder, method),
                "without": lambda: panel_image(folder, method, UpscaleOptions(selection=False))}
        return Selection(p=float(foreground(folder).mean()), seconds=timing.take_turns(runs, of.repeats),
                         distance=distance, scene=scene.stem, render=read_frame(folder).seconds["render"])

    key = scene.stem if distance is None else f"{scene.stem}-{distance:g}"
    return quality.measure_once(cells, key, inputs, measure)


def draw_share(results: Selections, _output: Path) -> plots.Figure:
    """Draw milliseconds over the fraction of foreground."""
    sheet, grid = plots.sheet(5, 3)
    for kind, color, line in zip(KINDS, plots.COLORS, _medians(results.by_share), strict=False):
        grid[0, 0].plot([row.p for row in results.by_share], line, marker="o", color=color, label=f"{kind} selection")
    grid[0, 0].set(xlabel="fraction of foreground lenses", ylabel="second stage, ms", ylim=(0, None), xlim=(0, 1.02))
    grid[0, 0].legend(frameon=False)
    return sheet


def draw_scenes(results: Selections, _output: Path) -> plots.Figure:
    """Draw two bars per scene."""
    sheet, grid = plots.sheet(6, 3)
    names = [f"{row.scene}\np = {row.p:.2f}" for row in results.rows]
    for index, (kind, bars) in enumerate(zip(KINDS, _medians(results.rows), strict=True)):
        grid[0, 0].bar([place + 0.4 * index - 0.2 for place in range(len(names))], bars, 0.38,
                       color=plots.COLORS[index], label=f"{kind} selection")
    grid[0, 0].set_xticks(range(len(names)), names, fontsize=7)
    grid[0, 0].set_ylabel("second stage, ms")
    grid[0, 0].margins(y=0.25)
    grid[0, 0].legend(frameon=False, fontsize=8, loc="upper left", ncols=2)
    return sheet


def _medians(rows: Iterable[Selection]) -> list[tuple[float, ...]]:
    """Milliseconds of every row, with selection and without."""
    return list(zip(*(row.medians for row in rows), strict=True))


def table_share(results: Selections) -> list[str]:
    """Return a table of distance, fraction of foreground, both times."""
    rows = [[f"{row.distance:g}", row.p, *(number(ms, digits=1) for ms in row.medians)] for row in results.rows]
    return markdown_table(["distance", "p", "ms with selection", "ms without"], rows)


def table_scenes(results: Selections) -> list[str]:
    """Return a table of times of every scene."""
    rows = [[row.scene, row.p, row.render, *(number(ms, digits=1) for ms in row.medians)] for row in results.rows]
    return markdown_table(["scene", "p", "render, s", "ms with selection", "ms without"], rows)


def line_share(results: Selections) -> str:
    """Return sentences on saved time at every fraction, and whether a smaller foreground saves more."""
    found = {f"p = {row.p:.2f}": row.saved for row in results.by_share}
    words = sentence("Selection saves time", found, "s")
    least, most = results.by_share[0], results.by_share[-1]
    if least.p == most.p:
        return f"{overall(found, {})} {words} Every distance has the same share, so nothing tells how it matters."
    order = {"": paired(least.saved_each, most.saved_each)}
    statement = f"It saves more at p = {least.p:.2f} than at p = {most.p:.2f}"
    return f"{overall(found, order)} {words} {sentence(statement, order, 's')}"


def line_scenes(results: Selections) -> str:
    """Return sentences on saved time per scene, also as a fraction of the frame."""
    found = {row.scene: row.saved for row in results.rows}
    shares = [100 * row.saved.value / (row.render + row.medians[1] / 1e3) for row in results.rows]
    return (f"{overall(found)} {sentence('Selection saves time', found, 's')} That is {min(shares):.1f} to "
            f"{max(shares):.1f} % of a whole frame with its render.")


@dataclasses.dataclass(frozen=True, kw_only=True)
class ScaleRow(Row):
    """One frame."""

    pixels: tuple[int, int]  # of the panel, horizontal and vertical
    scale: int  # factor, 1 for direct path tracing


@dataclasses.dataclass(frozen=True, kw_only=True)
class Scales(Results):
    """Frames of one scene."""

    rows: tuple[ScaleRow, ...]  # every resolution and scale
    render_device: str  # Cycles device
    scene: str = ""  # its name
    samples: int = 0  # per pixel

    @property
    def by_pixels(self) -> dict[tuple[int, int], list[ScaleRow]]:
        """Rows of each resolution, direct path tracing first."""
        sizes = dict.fromkeys(row.pixels for row in self.rows)
        return {pixels: sorted((row for row in self.rows if row.pixels == pixels), key=lambda row: row.scale)
                for pixels in sizes}


def measure_scales(settings: Settings) -> Scales:
    """Render and second stage of the first scene, every resolution and scale; scale 1 is direct."""
    cells, scene = quality.records_of(settings, "fig12a", ScaleRow), settings.scenes[0]
    displays = filter(None, (renders.resolution(settings.timing_display, part) for part in settings.resolutions))
    views = [View(scene, scale, settings.spp, display) for display in displays
             for scale in (1, *(s for s in display.scales() if s in catalogue.spec(NETWORK).scales))]
    return Scales(rows=tuple(_scale(settings, cells, view) for view in views), scene=scene.stem, samples=settings.spp,
                  render_device=settings.render_device, load=cells.load)


def _scale(settings: Settings, cells: Records[ScaleRow], view: View) -> ScaleRow:
    """For direct path tracing the second stage runs without an upscaler."""
    display = view.display or settings.display
    pixels = display.eia_pixels
    inputs = {"scene": view.scene.stem, "display": display.to_dict(), "scale": view.scale, "spp": view.spp,
              "device": settings.device, "render_device": settings.render_device}

    def measure() -> ScaleRow:
        folder = renders.low_resolution(settings, view)
        method = weights.untrained_method(settings, NETWORK if view.scale > 1 else "none", view.scale)
        return ScaleRow(pixels=pixels, scale=view.scale, render=read_frame(folder).seconds["render"],
                        second_stage=quality.second_stage_seconds(settings, folder, method))

    return quality.measure_once(cells, f"{view.scene.stem}-{pixels[1]}-s{view.scale}", inputs, measure)


def draw_scales(results: Scales, _output: Path) -> plots.Figure:
    """Draw seconds per frame over the scale factor, a line per resolution."""
    sheet, grid = plots.sheet(5.5, 3.2)
    for color, ((width, height), rows) in zip(plots.COLORS, results.by_pixels.items(), strict=False):
        grid[0, 0].plot([row.scale for row in rows], [row.total for row in rows], "o-", color=color,
                        label=f"{width}×{height}")
    grid[0, 0].set(xlabel="scale factor (1: direct path tracing)", ylabel="seconds per frame", yscale="log")
    grid[0, 0].set_xticks(sorted({row.scale for row in results.rows}))
    grid[0, 0].legend(frameon=False, fontsize=8)
    return sheet


def table_scales(results: Scales) -> list[str]:
    """Return a table of both stages, the sum, and how many times faster than direct."""
    rows = [[f"{width}×{height}", row.scale if row.scale > 1 else "direct", row.render, row.second_stage, row.total,
             number(found[0].total / row.total, digits=1)]
            for (width, height), found in results.by_pixels.items() for row in found]
    return markdown_table(["resolution", "scale", "render, s", "second stage, s", "sum, s", "times as fast"], rows)


def line_scales(results: Scales) -> str:
    """Return sentences on direct minus two stages in every cell, and the frame rate."""
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


SHARE = Figure("fig10b", "Fig. 10(b): fraction of foreground", CLAIM_SHARE, Selections, measure_share, table_share,
               line_share, draw_share)
SCALES = Figure("fig12a", "Fig. 12(a): scale factors and resolutions", CLAIM_SCALE, Scales, measure_scales,
                table_scales, line_scales, draw_scales)
SCENES = Figure("fig12b", "Fig. 12(b): foreground selection", CLAIM_SCENES, Selections, measure_scenes, table_scenes,
                line_scenes, draw_scenes)
