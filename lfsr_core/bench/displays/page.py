"""What people read of the comparison: a table and a picture."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import TYPE_CHECKING

from lfsr_core.bench.displays.measure import Point
from lfsr_core.bench.displays.ways import DIRECT, NAMES, OURS, USUAL
from lfsr_core.bench.environment import Environment
from lfsr_core.bench.plots import (
    COLORS,
    MARKERS,
    Curve,
    draw_curve,
    height,
    name_curves,
    panel_sheet,
    time_axis,
    value_axis,
)
from lfsr_core.bench.tables import markdown_table, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HEADER = ("scene", "display", "way", "samples", "render", "rest", "CPU s", "PSNR panel", "PSNR eye", "SSIM eye")


@dataclasses.dataclass(frozen=True)
class Row:
    """One scene on one display."""

    scene: str
    kind: str
    panel_pixels: tuple[int, int]
    scale: int  # by which we divide views
    points: tuple[Point, ...]


@dataclasses.dataclass(frozen=True)
class Comparison:
    """Everything that was measured."""

    width: int | None  # pixels of cut-down panels, None for the real ones
    reference_spp: int
    environment: Environment
    rows: tuple[Row, ...]


def markdown(found: Comparison) -> str:
    """Tables of every point and of what they say."""
    lines = [f"{found.environment.machine}; {found.environment.packages}.", "",
             *(f"- {name}: {text}." for name, text in NAMES.items()), "",
             *markdown_table(("scene", "display", "against", "at samples", "its SSIM eye", "its CPU s", "ours CPU s",
                              "times"), _verdicts(found), "lll"), "",
             *markdown_table(HEADER, _lines(found), "lll")]
    return "\n".join(lines) + "\n"


def seconds_for(points: tuple[Point, ...], value: float) -> float | None:
    """CPU seconds at which a way's curve first reaches an ``ssim_eye``, by the logarithm of time between two points.

    None where it never does. Better already at its first point: that point's seconds.
    """
    before = None
    for point in points:
        reached = point.accuracy.ssim_eye
        if reached >= value:
            if before is None:
                return point.cpu
            share = (value - before.accuracy.ssim_eye) / (reached - before.accuracy.ssim_eye)
            return before.cpu * (point.cpu / before.cpu) ** share
        before = point
    return None


def picture(found: Comparison) -> Figure:
    """A panel per scene and display: what eyes see, by processor seconds."""
    displays = len({row.kind for row in found.rows})
    figure, grid = panel_sheet(len(found.rows), displays, "Up and left is better: split SSIM of what eyes see, against "
                               f"{found.reference_spp} samples per pixel; processor seconds on all cores, of one run")
    for axes, row in zip(grid, found.rows, strict=True):
        _panel(axes, row)
    return figure


def _of(row: Row, way: str) -> tuple[Point, ...]:
    return tuple(point for point in row.points if point.way == way)


def _lines(found: Comparison) -> Iterator[tuple]:
    for row in found.rows:
        for point in row.points:
            close = point.accuracy
            yield (row.scene, row.kind, point.way, point.samples, number(point.render_cpu, digits=1),
                   number(point.finish_cpu, digits=1), number(point.cpu, digits=1), number(close.psnr_panel, digits=2),
                   number(close.psnr_eye, digits=2), number(close.ssim_eye, digits=4))


def _verdicts(found: Comparison) -> Iterator[tuple]:
    """What each point of the other ways costs us."""
    for row in found.rows:
        for rival in (point for way in (DIRECT, USUAL) for point in _of(row, way)):
            ours = seconds_for(_of(row, OURS), rival.accuracy.ssim_eye)
            yield (row.scene, row.kind, rival.way, rival.samples, number(rival.accuracy.ssim_eye, digits=4),
                   number(rival.cpu, digits=1), number(ours, digits=1), number(ours and rival.cpu / ours, digits=1))


def _panel(axes: Axes, row: Row) -> None:
    curves = [Curve(way, COLORS[index], MARKERS[index], [point.cpu for point in points],
                    [point.accuracy.ssim_eye for point in points], notes=[str(point.samples) for point in points],
                    bold=way == OURS)
              for index, way in enumerate((OURS, DIRECT, USUAL)) if (points := _of(row, way))]
    seconds, values = ([value for curve in curves for value in getattr(curve, axis)] for axis in "xy")
    time_axis(axes, min(seconds) / 1.3, max(seconds) * 1.3)
    value_axis(axes, height(min(values)) - 0.3, height(max(values)) + 0.3, toward_one=True)
    axes.set_title(f"{row.scene}, {row.kind} {row.panel_pixels[0]}×{row.panel_pixels[1]}", loc="left", fontsize=14)
    axes.grid(color="#e6e6e6")
    for curve in curves:
        draw_curve(axes, curve)
    name_curves(axes, curves)
