"""Fig. 10(b), 12(a), 12(b) and Table 2: times of whole frames, and what foreground selection saves."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator, Sequence
from pathlib import Path

from lfsr_core.frames.frame import read_frame
from lfsr_core.reconstruct.methods import DEFAULT_METHOD
from lfsr_core.reconstruct.second_stage import finished_panel
from lfsr_lab.experiments.engine import plots, timing
from lfsr_lab.experiments.engine.records import Cell, foreground
from lfsr_lab.experiments.seed_paper import figure as fig
from lfsr_lab.experiments.seed_paper import measuring
from lfsr_lab.networks import comparators

NETWORK, DIRECT = "paper", "direct"
WITH, WITHOUT = "with selection", "without selection"
REALTIME, WIDTH_8K = 30, 7680
CLAIM_FRACTION = "Foreground selection saves time, the more the smaller the foreground is."
CLAIM_SCENES = "Foreground selection saves time on every model."
BY_VIEW, FEW_SAMPLES = "view by view + fsrcnn", "1 sample + oidn"
PAPER, PAPER_PLAIN, OURS = "paper (adversary)", "paper (no adversary)", "this project"
RIVALS = (DIRECT, BY_VIEW, FEW_SAMPLES)
PLAIN, ENOUGH_SSIM = "ssim_eia_plain", 0.90
CLAIM_RIVALS = f"The paper's method is faster than every rival, with an SSIM above {ENOUGH_SSIM:.2f}."
RIVAL_COLUMNS = (*measuring.FRAME_COLUMNS, PLAIN, "ssim_ceiling", "ssim_eia_fg", "psnr_fg")
CLAIM_SCALE = f"Two stages take less time than direct path tracing, and reach {REALTIME} frames per second at 8K."


def selection(settings: measuring.Settings, scene: Path, distance: float | None = None) -> Cell[measuring.Rows]:
    """Return the cell of the second stage of one frame with and without foreground selection, in turns."""
    display = settings.timing_display
    name = scene.stem if distance is None else f"distance {distance:g}"
    inputs = {"scene": scene.stem, "distance": distance, "display": display.to_dict(), "spp": settings.spp,
              "repeats": settings.repeats, "device": settings.device, "render_device": settings.render_device}

    def measure() -> measuring.Rows:
        seen = scene if distance is None else measuring.moved(settings, scene, distance)
        folder = measuring.rendered(settings, measuring.View(seen, settings.spp, display=display))
        finish, upscaler = measuring.untrained_method(settings, NETWORK, measuring.SCALE)
        runs = {kind: functools.partial(finished_panel, folder, finish, selection=kind == WITH, upscaler=upscaler)
                for kind in (WITH, WITHOUT)}
        facts = {"p": float(foreground(folder).mean()), measuring.RENDER: read_frame(folder).seconds["render"]}
        return measuring.timed_rows(timing.take_turns(runs, settings.repeats), scene=name, facts=facts)

    return Cell(f"{scene.stem}-{name}".replace(" ", "-"), inputs, measure)


def draw_selection(rows: Sequence[measuring.Row], _folder: Path) -> plots.Figure:
    """Draw two bars per scene or distance, from the smallest foreground to the largest."""
    sheet, grid = plots.sheet(6, 3)
    for index, kind in enumerate((WITH, WITHOUT)):
        shown = sorted((row for row in rows if row.method == kind), key=_p)
        grid[0, 0].bar([place + 0.4 * index - 0.2 for place in range(len(shown))], [row.value("ms") for row in shown],
                       0.38, color=plots.COLORS[index], label=kind)
        grid[0, 0].set_xticks(range(len(shown)), [f"{row.scene}\np = {_p(row):.2f}" for row in shown], fontsize=7)
    grid[0, 0].set_ylabel("second stage, ms")
    grid[0, 0].margins(y=0.25)
    grid[0, 0].legend(frameon=False, fontsize=8, loc="upper left", ncols=2)
    return sheet


def rule_fraction(rows: Sequence[measuring.Row]) -> str:
    """Return what selection saves, and whether a smaller foreground saves more."""
    gains = fig.gains(rows, WITHOUT, WITH, measuring.SECONDS)
    least, most = min(rows, key=_p), max(rows, key=_p)
    order = {"": fig.paired(_saved(rows, least), _saved(rows, most))} if _p(least) < _p(most) else {}
    statement = f"It saves more at p = {_p(least):.2f} than at p = {_p(most):.2f}"
    saves = fig.sentence("Selection saves time", gains, "s")
    return f"{fig.overall(gains, order)} {saves} {fig.sentence(statement, order, 's')}"


def rule_scenes(rows: Sequence[measuring.Row]) -> str:
    """Return what selection saves on each scene, also as a fraction of the frame."""
    gains = fig.gains(rows, WITHOUT, WITH, measuring.SECONDS)
    whole = {row.scene: row.value(measuring.RENDER) + row.value("ms") / 1e3 for row in rows if row.method == WITHOUT}
    percent = [100 * saved.value / whole[scene] for scene, saved in gains.items()]
    return (f"{fig.overall(gains)} {fig.sentence('Selection saves time', gains, 's')} That is {min(percent):.1f} to "
            f"{max(percent):.1f} % of a whole frame with its render.")


def _p(row: measuring.Row) -> float:
    return row.value("p")


def _saved(rows: Sequence[measuring.Row], at: measuring.Row) -> list[float]:
    """Return the seconds that selection saves in each pair of runs of one scene."""
    runs = {row.method: row.series[measuring.SECONDS] for row in rows if row.scene == at.scene}
    return [slow - fast for slow, fast in zip(runs[WITHOUT], runs[WITH], strict=True)]


def scale_cells(settings: measuring.Settings) -> Iterator[Cell[measuring.Rows]]:
    """Yield render and second stage of the first scene, every resolution and scale; scale 1 is direct."""
    for divisor in settings.resolutions:
        display = measuring.resolution(settings.timing_display, divisor)
        for scale in (1, *display.scales()) if display else ():
            if scale == 1 or scale in comparators.SCALES:
                yield scale_cell(settings, measuring.View(settings.scenes[0], settings.spp, scale, display))


def scale_cell(settings: measuring.Settings, view: measuring.View) -> Cell[measuring.Rows]:
    """Return the cell of one frame; for direct path tracing the second stage runs without an upscaler."""
    display = view.display or settings.display
    width, height = display.eia_pixels
    inputs = {"scene": view.scene.stem, "display": display.to_dict(), "scale": view.scale, "spp": view.spp,
              "device": settings.device, "render_device": settings.render_device, "repeats": settings.repeats}

    def measure() -> measuring.Rows:
        folder = measuring.rendered(settings, view)
        method = measuring.untrained_method(settings, NETWORK if view.scale > 1 else "none", view.scale)
        name = f"s = {view.scale}" if view.scale > 1 else DIRECT
        values = {"width": width, "scale": view.scale, **measuring.frame_seconds(settings, folder, method)}
        return measuring.Rows((measuring.Row(scene=f"{width}×{height}", method=name, samples=view.spp, values=values),))

    return Cell(f"{view.scene.stem}-{height}-s{view.scale}", inputs, measure)


def draw_scales(rows: Sequence[measuring.Row], _folder: Path) -> plots.Figure:
    """Draw seconds per frame over the scale factor, a line per resolution."""
    sheet, grid = plots.sheet(5.5, 3.2)
    for color, scene in zip(plots.COLORS, fig.scenes_of(rows), strict=False):
        points = sorted((row.value("scale"), row.value(measuring.TOTAL)) for row in rows if row.scene == scene)
        grid[0, 0].plot(*zip(*points, strict=True), "o-", color=color, label=scene)
    grid[0, 0].set(xlabel="scale factor (1: direct path tracing)", ylabel="time per frame", yscale="log")
    ticks = plots.time_ticks(*grid[0, 0].get_ylim())
    grid[0, 0].set_yticks(ticks, map(plots.time_text, ticks))
    grid[0, 0].set_yticks([], minor=True)
    grid[0, 0].set_xticks(sorted({int(row.value("scale")) for row in rows}))
    grid[0, 0].legend(frameon=False, fontsize=8)
    return sheet


def rule_scales(rows: Sequence[measuring.Row]) -> str:
    """Return direct minus two stages in every cell, and the frame rate."""
    direct = {row.scene: row.value(measuring.TOTAL) for row in rows if row.method == DIRECT}
    ours = [row for row in rows if row.method != DIRECT]
    saved = {f"{row.scene} at {row.method}": fig.single_runs(direct[row.scene], row.value(measuring.TOTAL))
             for row in ours}
    times = [direct[row.scene] / row.value(measuring.TOTAL) for row in ours]
    best = max(ours, key=lambda row: (row.value("width"), -row.value(measuring.TOTAL)))
    rate = 1 / best.value(measuring.TOTAL)
    # The bound is for 8K; a smaller frame cannot tell.
    realtime = {"": fig.single_runs(rate, REALTIME)} if best.value("width") >= WIDTH_8K else {}
    return (f"{fig.overall(saved, realtime)} {fig.sentence('Two stages take less time', saved, 's')} They are "
            f"{min(times):.1f} to {max(times):.1f} times as fast. Renders were timed once: less than "
            f"{100 * fig.SINGLE_RUN:.0f} % of difference does not count. "
            f"{fig.sentence(f'Above {REALTIME} frames per second at 8K', realtime, 'frames per second')} The fastest "
            f"at {best.scene} is {best.method} with {rate:.3g} frames per second, "
            f"{100 * best.value(measuring.RENDER) / best.value(measuring.TOTAL):.0f} % of it the render.")


def rival_cells(settings: measuring.Settings) -> Iterator[Cell[measuring.Rows]]:
    """Yield every rival on every scene."""
    for scene in settings.scenes:
        view = measuring.View(scene, settings.spp)
        whole = dataclasses.replace(view, scale=1)
        by_view = dataclasses.replace(view, layout="view-by-view")
        for name, seen, method in ((DIRECT, whole, "none"), (BY_VIEW, by_view, "fsrcnn"),
                                   (FEW_SAMPLES, dataclasses.replace(whole, spp=1), "oidn"), (PAPER, view, "paper-gan"),
                                   (PAPER_PLAIN, view, "paper"), (OURS, view, DEFAULT_METHOD)):
            yield measuring.accuracy_cell(settings, "table2", seen, method, functools.partial(_rival, settings), name,
                                device=settings.device, render_device=settings.render_device, repeats=settings.repeats)


def _rival(settings: measuring.Settings, made: measuring.Finished) -> measuring.Row:
    row, seconds = measuring.accuracy(made), measuring.frame_seconds(settings, made.folder, made.method)
    return dataclasses.replace(row, how=f"s{made.frame.scale}", values={**row.values, **seconds})


def rule_rivals(rows: Sequence[measuring.Row]) -> str:
    """Return the paper's method, with its adversary if it was trained, against each rival."""
    measured = [row for row in rows if row.values]
    ours = next((name for name in (PAPER, PAPER_PLAIN) if any(row.method == name for row in measured)), None)
    if ours is None:
        return fig.overall()
    mine = [row for row in measured if row.method == ours]
    total = {(row.scene, row.method): row.value(measuring.TOTAL) for row in measured}
    faster = {rival: {row.scene: fig.single_runs(total[row.scene, rival], total[row.scene, ours])
                      for row in mine if (row.scene, rival) in total} for rival in RIVALS}
    # Plain SSIM is the paper's own figure; over all lenses it has no interval.
    enough = {row.scene: fig.Difference(row.value(PLAIN) - ENOUGH_SSIM) for row in mine}
    words = [fig.overall(*faster.values(), enough), f"Of {ours}:"]
    words += [fig.sentence(f"Faster than {rival}", differences, "s") for rival, differences in faster.items()]
    words.append(fig.sentence(f"Plain SSIM above {ENOUGH_SSIM:.2f}", enough, f"from {ENOUGH_SSIM:.2f}"))
    words += [fig.sentence(f"More accurate than {rival}", fig.gains(rows, ours, rival), "split SSIM")
              for rival in (*RIVALS, OURS)]
    return " ".join(words)


FRACTION = fig.Figure("fig10b", "Fig. 10(b): fraction of foreground", CLAIM_FRACTION, lambda settings: [
    selection(settings, settings.scenes[0], distance) for distance in settings.moves], ("p", "ms"), rule_fraction,
    draw_selection)
SCALES = fig.Figure("fig12a", "Fig. 12(a): scale factors and resolutions", CLAIM_SCALE, scale_cells,
                measuring.FRAME_COLUMNS, rule_scales, draw_scales)
SCENES = fig.Figure("fig12b", "Fig. 12(b): foreground selection", CLAIM_SCENES, lambda settings: [
    selection(settings, scene) for scene in settings.scenes], ("p", measuring.RENDER, "ms"), rule_scenes,
    draw_selection)
TABLE2 = fig.Figure("table2", "Table 2: rivals", CLAIM_RIVALS, rival_cells, RIVAL_COLUMNS, rule_rivals,
                methods=("fsrcnn", "paper-gan", "paper", DEFAULT_METHOD))
