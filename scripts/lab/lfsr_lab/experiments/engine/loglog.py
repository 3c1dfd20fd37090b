"""Errors against cost, both logarithmic: where noise alone is a straight line."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from lfsr_lab.experiments.engine import plots
from lfsr_lab.experiments.engine.measures import FLIP, SMAPE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SLOPES = {-0.5: "−½", -1.0: "−1"}  # of noise alone: of errors that grow with its size, and with its square
LINEAR = (SMAPE, FLIP)
NOISE = "#ececec"
TICKS = (1, 2, 5)
MOST_TICKS = 8


def cost_axis(axes: Axes, low: float, high: float, seconds: bool) -> None:
    """Set a logarithmic axis of seconds, or of rays per finished pixel."""
    if seconds:
        plots.time_axis(axes, low, high)
        return
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    powers = range(math.floor(math.log2(low)), math.ceil(math.log2(high)) + 1)
    ticks = [2.0**power for power in powers if power % 2 == 0 and low <= 2.0**power <= high]
    axes.set_xticks(ticks, [f"{tick:g}" if tick >= 1 else f"1/{1 / tick:.0f}" for tick in ticks])
    axes.set_xticks([], minor=True)


def error_axis(axes: Axes, low: float, high: float) -> None:
    """Set a logarithmic axis of errors."""
    axes.set_yscale("log")
    axes.set_ylim(low, high)
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for steps in (TICKS, (1, 3), (1,)):
        ticks = [step * 10.0**power for power in powers for step in steps if low <= step * 10.0**power <= high]
        if len(ticks) <= MOST_TICKS:
            break
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_yticks([], minor=True)


def draw_slopes(axes: Axes, measure: str, start: tuple[float, float]) -> list[Any]:
    """Draw the slopes of noise alone from ``start`` to the right and name them; return the names.

    −½ in every panel; −1 too where the error is a square, so that its root has −½.
    """
    right, bottom = axes.get_xlim()[1], axes.get_ylim()[0]
    names = []
    for slope in list(SLOPES)[:1 if measure in LINEAR else 2]:
        end = min(right, start[0] * (bottom / start[1])**(1 / slope))
        axes.plot([start[0], end], [start[1], start[1] * (end / start[0])**slope], color=plots.QUIET, linewidth=1.1,
                  linestyle=(0, (1.3, 2.7)), zorder=2.2)
        at = start[0] * (end / start[0])**0.93
        names.append(axes.annotate(f"slope {SLOPES[slope]}", (at, start[1] * (at / start[0])**slope), (3, 4),
                                   textcoords="offset points", fontsize=10.5, color=plots.QUIET, zorder=8))
    return names


def draw_noise(axes: Axes, noise: float) -> list[Any]:
    """Shade the errors below the reference's own, and return the words there; none where it lies below the panel."""
    bottom = axes.get_ylim()[0]
    if noise <= bottom:
        return []
    axes.axhspan(bottom, noise, color=NOISE, zorder=1)
    return [axes.annotate("the reference's own noise", (0, noise), (3, -4), va="top", textcoords="offset points",
                          xycoords=("axes fraction", "data"), fontsize=10.5, color=plots.QUIET, zorder=8)]


def limits(values: Sequence[float], room: float) -> tuple[float, float]:
    """Return the ends of a logarithmic axis of ``values`` above 0, with ``room`` of its length beyond each end."""
    low, high = math.log(min(values)), math.log(max(values))
    space = room * max(high - low, 0.5)
    return math.exp(low - space), math.exp(high + space)
