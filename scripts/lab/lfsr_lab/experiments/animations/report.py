"""The report of the animations: records, tables and chart."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from lfsr_lab.experiments.animations.accuracy import Figures
from lfsr_lab.experiments.animations.cells import ALONE, AVERAGED, FIXED_ALONE, NAMES, Settings
from lfsr_lab.experiments.engine import plots
from lfsr_lab.experiments.engine.environment import Environment
from lfsr_lab.experiments.engine.report import markdown_table

STEM = "shots"  # of the files
TITLES = {"object": "an object moves", "light": "the light moves", "dance": "a figure dances",
          "array": "the camera array moves"}
HEADER = ("", "samples", "split SSIM", "flicker", "low-frequency error", "lag, frames")
SHOWN = {"ssim": "split SSIM", "flicker": "flicker, %"}
DRAWN = {FIXED_ALONE.name: "fixed seeds", ALONE.name: "changing seeds", AVERAGED.name: "averaged, 5 frames"}


@dataclasses.dataclass(frozen=True)
class Found:
    """The figures of one way of one animation."""

    animation: str = dataclasses.field(metadata={"key": "shot"})
    way: str
    samples: int
    figures: Figures


@dataclasses.dataclass(frozen=True)
class Report:
    """All of them, and what they were measured with."""

    settings: Settings
    environment: Environment
    command: str
    found: tuple[Found, ...]


def markdown(found: Sequence[Found]) -> str:
    """Return a table per animation."""
    lines: list[str] = []
    for name in dict.fromkeys(each.animation for each in found):
        rows = [(each.way, each.samples, f"{each.figures.ssim:.4f}", f"{each.figures.flicker:.2f}",
                 f"{each.figures.offset:.2f}", f"{each.figures.lag:.2f}") for each in found if each.animation == name]
        lines += [f"**{TITLES[name]}**", "", *markdown_table(HEADER, rows, "lr"), ""]
    return "\n".join(lines)


def chart(found: Sequence[Found]) -> Any:
    """Draw a column per animation: split SSIM above, flicker below, over the samples."""
    names = [name for name in NAMES if any(each.animation == name for each in found)]
    figure, grid = plots.panel_sheet(len(SHOWN) * len(names), columns=len(names))
    for axes, (kind, name) in zip(grid, [(kind, name) for kind in SHOWN for name in names], strict=True):
        curves = [_curve(found, name, way, kind) for way in DRAWN]
        axes.set_xscale("log", base=2)
        ticks = sorted({x for curve in curves for x in curve.x})
        axes.set_xticks(ticks, [f"{tick:g} samples" if tick == ticks[0] else f"{tick:g}" for tick in ticks])
        axes.set_xticks([], minor=True)
        axes.margins(0.08)
        plots.draw_curves(axes, curves, f"{TITLES[name]}: {SHOWN[kind]}")
    return figure


def _curve(found: Sequence[Found], name: str, way: str, kind: str) -> plots.Curve:
    points = sorted((each.samples, getattr(each.figures, kind)) for each in found
                    if each.animation == name and each.way == way)
    number = list(DRAWN).index(way)
    x, y = zip(*points, strict=True)
    return plots.Curve(DRAWN[way], plots.COLORS[number], plots.MARKERS[number], x, y, bold=way == AVERAGED.name)
