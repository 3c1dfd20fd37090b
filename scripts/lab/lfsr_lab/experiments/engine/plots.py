"""Charts by matplotlib: the same image for the same figures, in colours and shapes that every eye tells apart.

Names stand beside what they name instead of in a legend, moved to where they hide least. A figure becomes an SVG
document (its text stays text) or a PNG file, both without a date in them.
"""

from __future__ import annotations

import dataclasses
import io
import itertools
import math
import re
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.system import atomic_path
from lfsr_lab.experiments.engine.truth import FLIP, SMAPE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation
    from matplotlib.transforms import Bbox

# Apart in lightness too, for eyes that do not tell red from green (after Okabe and Ito).
COLORS = ("#0067a5", "#c24a00", "#9c4477", "#00785a", "#7a5c00", "#2b2b2b", "#4b3fa7")
MARKERS = ("o", "s", "^", "D", "v", "X", "P")
INK, QUIET, FAINT, GRID = "#222222", "#555555", "#b8b8b8", "#e6e6e6"
DPI = 90  # of PNG files
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 540, 430, 52, 116, 44, 46  # a panel and its margins in points; names go right
STYLE: dict[Any, Any] = {"svg.fonttype": "none", "svg.hashsalt": "lfsr"}
FOOTER_CHARACTER = 8  # points that a character of the footer takes, margins included
NAME_LENGTH = 14  # of a line
LEAST_X_TICKS, MOST_X_TICKS, MOST_Y_TICKS = 3, 7, 12
TICKS_TOWARD_ONE = (-1.0, 0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.75, 0.8, 0.85, 0.9, 0.92, 0.94, 0.95, 0.96, 0.97, 0.98,
                    0.99, 0.995, 0.998, 0.999)
WIDE_TICKS = (-1.0, 0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.998, 0.999)
LEAST_MISSING = 5e-4  # 1 − value: split SSIM can come out at 1 or a little above
LINE_STEP = 12.0  # pixels between the places of a line that names keep away from
# In points from what is named; the further up or down, the further right, so that lines to names cross no name.
NAME_PLACES = [(9.0 + 1.5 * step, 6.0 * step * sign) for step in range(26) for sign in (1, -1)]
FAR = 14.0  # points from what is named, from where on a line leads to the name
NOTE_PLACES = [(-8.0, 8.0), (8.0, -9.0), (8.0, 8.0), (-8.0, -9.0), (0.0, 12.0), (0.0, -13.0)]


@dataclasses.dataclass(frozen=True)
class Curve:
    name: str  # written beside its last point
    color: str  # one of COLORS
    marker: str  # one of MARKERS, for eyes that do not know the colours apart
    x: Sequence[float]  # of its points, from left to right
    y: Sequence[float]
    spans: Sequence[tuple[float, float]] = ()  # least and most x of each point, as thin lines
    bars: Sequence[tuple[float, float]] = ()  # ends of the interval of each y, as thin lines
    notes: Sequence[str] = ()  # a short text at each point
    bold: bool = False  # drawn thicker than the others


def sheet(width: float, height: float, rows: int = 1, columns: int = 1) -> tuple[Figure, Any]:
    """A figure, drawn without a window, and its axes.

    Parameters
    ----------
    width, height : of the figure in inches
    rows, columns : of the axes, which come as an array of that shape
    """
    figure = _figure(width, height, layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False)


def panel_sheet(count: int, columns: int = 2, footer: str = "") -> tuple[Figure, list[Axes]]:
    """A figure of so many panels of WIDTH × HEIGHT points in rows of ``columns``, and their axes; ``footer`` below."""
    across, down = min(columns, count), -(-count // columns)
    lines = textwrap.wrap(footer, across * WIDTH // FOOTER_CHARACTER)
    width, tall = across * WIDTH, down * HEIGHT + (12 + 16 * len(lines) if lines else 0)
    figure = _figure(width / 72, tall / 72)
    figure.text(LEFT / width, 12 / tall, "\n".join(lines), fontsize=12, color=QUIET)
    corners = [(index % columns * WIDTH + LEFT, tall - (index // columns + 1) * HEIGHT + BOTTOM)
               for index in range(count)]
    grid = [figure.add_axes((x / width, y / tall, (WIDTH - LEFT - RIGHT) / width, (HEIGHT - TOP - BOTTOM) / tall))
            for x, y in corners]
    for axes in grid:
        axes.spines[:].set_visible(False)
        axes.tick_params(length=0, labelsize=12, labelcolor=INK)
    return figure, grid


def svg(figure: Figure) -> str:
    from matplotlib import rc_context

    with rc_context(STYLE):
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    return re.sub(r"[ \t]+$", "", text.getvalue(), flags=re.MULTILINE)


def save(figure: Figure, path: Path) -> None:
    """Write the figure as a small PNG, whole or not at all."""
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=DPI, metadata={"Software": None}, pil_kwargs={"optimize": True})


def draw_curve(axes: Axes, curve: Curve, order: float = 3) -> None:
    """Draw a curve without its name; a higher ``order`` lies on top."""
    axes.plot(curve.x, curve.y, color=curve.color, marker=curve.marker, markersize=8 if curve.bold else 7,
              linewidth=3 if curve.bold else 1.8, zorder=order)
    thin: dict[str, Any] = {"color": curve.color, "linewidth": 1.2, "alpha": 0.6, "zorder": order}
    if curve.spans:
        axes.hlines(curve.y, *np.transpose(curve.spans), **thin)
    if curve.bars:
        axes.vlines(curve.x, *np.transpose(curve.bars), **thin)


def name_curves(axes: Axes, curves: Sequence[Curve], taken: Iterable[Any] = ()) -> None:
    """Write notes at the points and each curve's name beside its last one, where they hide least.

    Call it when the limits of ``axes`` and its place on the figure are final. ``taken``: texts that are there already.
    """
    crowd = _Crowd.of(axes, curves, [text.get_window_extent() for text in taken])
    for curve in curves:
        for at, note in zip(zip(curve.x, curve.y, strict=True), curve.notes, strict=False):
            crowd.place(_text(axes, note, at, color=curve.color, size=11, ha="center"), NOTE_PLACES)
    for curve in sorted(curves, key=lambda curve: -curve.y[-1]):
        leader = {"arrowstyle": "-", "color": curve.color, "linestyle": (0, (2, 2)), "relpos": (0, 0.5), "shrinkB": 4}
        text = _text(axes, broken(curve.name), (curve.x[-1], curve.y[-1]), color=curve.color, size=12, weight="bold",
                     arrowprops=leader)
        crowd.place(text, NAME_PLACES)


def draw_curves(axes: Axes, curves: Sequence[Curve], title: str) -> None:
    """Draw and name the curves of a panel whose axes are set, over a grid."""
    axes.set_title(title, loc="left", fontsize=14, color=INK)
    axes.grid(color=GRID)
    for curve in curves:
        draw_curve(axes, curve)
    axes.autoscale_view()
    name_curves(axes, curves)


def time_axis(axes: Axes, low: float, high: float) -> None:
    """Set a logarithmic axis of seconds from ``low`` to ``high``, with units that are easy to read."""
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    axes.set_xticks(ticks := time_ticks(low, high), [time_text(tick) for tick in ticks])
    axes.set_xticks([], minor=True)


def time_text(seconds: float) -> str:
    """Return seconds in the unit that is easiest to read."""
    if seconds >= 3600:
        return f"{seconds / 3600:.3g} h"
    if seconds >= 180:
        return f"{seconds / 60:.2g} min"
    return f"{seconds:.3g} s" if seconds < 10 else f"{seconds:.0f} s"


def time_ticks(low: float, high: float) -> list[float]:
    """Round seconds between ``low`` and ``high``, few enough to be read; in even steps where 1-2-5 gives too few."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for steps in ((1, 2, 5), (1, 3), (1,)):
        ticks = [step * 10.0**power for power in decades for step in steps]
        ticks = [tick for tick in ticks if low <= tick <= high]
        if len(ticks) <= MOST_X_TICKS:
            break
    if len(ticks) < LEAST_X_TICKS:
        from matplotlib.ticker import MaxNLocator

        even = MaxNLocator(6, steps=[1, 2, 5, 10], min_n_ticks=LEAST_X_TICKS).tick_values(low, high)
        ticks = [float(tick) for tick in even if low <= tick <= high]
    return ticks


def value_axis(axes: Axes, low: float, high: float) -> None:
    """Set an axis of values up to 1 on which equal steps up halve 1 − value; ``low`` and ``high`` as of ``height``."""
    axes.set_yscale("function", functions=(height, lambda heights: 1 - 0.5 ** np.asarray(heights)))
    axes.set_ylim(1 - 0.5**low, 1 - 0.5**high)
    ticks = [tick for tick in TICKS_TOWARD_ONE if low <= height(tick) <= high]
    ticks = [tick for tick in ticks if tick in WIDE_TICKS] if len(ticks) > MOST_Y_TICKS else ticks
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])


def height(values: Any) -> Any:
    """Return the places of values on an axis that stretches towards 1: how often 1 − value was halved."""
    return -np.log2(np.maximum(1 - np.asarray(values), LEAST_MISSING))


def broken(name: str) -> str:
    """Return a name in lines of about NAME_LENGTH characters, broken before a plus or at a blank."""
    lines = textwrap.wrap(name.replace("+", " +"), NAME_LENGTH, break_long_words=False, break_on_hyphens=False)
    return "\n".join(lines).replace(" +", "+")


def _figure(width: float, tall: float, **options: Any) -> Figure:
    from matplotlib import rcParams
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rcParams["text.parse_math"] = False  # names of files may have a $
    figure = Figure(figsize=(width, tall), **options)
    FigureCanvasAgg(figure)  # which knows at once how large a text will be
    return figure


@dataclasses.dataclass
class _Crowd:
    """What a text of a panel must keep away from, in pixels."""

    room: Bbox  # where texts may be
    dots: Array  # (n, 2) points of curves
    lines: Array  # (n, 2) places along their lines
    boxes: list[Bbox]  # texts that have their place

    @classmethod
    def of(cls, axes: Axes, curves: Sequence[Curve], boxes: list[Bbox]) -> _Crowd:
        """All curves of a panel, whose room reaches from its axes to the right by RIGHT points."""
        paths = [axes.transData.transform(np.column_stack([curve.x, curve.y])) for curve in curves]
        lines = [np.linspace(one, other, max(2, int(math.dist(one, other) / LINE_STEP)))
                 for path in paths for one, other in itertools.pairwise(path)]
        room = axes.bbox.frozen()
        room.x1 += (RIGHT - 2) * axes.figure.dpi / 72
        return cls(room, np.concatenate(paths), np.concatenate([np.empty((0, 2)), *lines]), boxes)

    def place(self, text: Annotation, places: Sequence[tuple[float, float]]) -> None:
        """Move a text to the best of ``places``, in points from what it names; the earlier the better."""
        assert text.axes is not None
        start, pixel = text.get_window_extent(), text.axes.figure.dpi / 72
        moved = [start.translated(across * pixel, up * pixel) for across, up in places]
        best, least = 0, math.inf
        for index, box in enumerate(moved):
            if index >= least:  # no later place can be better
                break
            if (hidden := index + self._hidden(box)) < least:
                best, least = index, hidden
        text.set_position(places[best])
        if text.arrow_patch:  # a thin line to a name that had to go far
            text.arrow_patch.set_visible(abs(places[best][1]) > FAR)
        self.boxes.append(moved[best])

    def _hidden(self, box: Bbox) -> float:
        """How much a text there would hide: other texts and the room's edge weigh most, then points, then lines."""
        inside = self.room.contains(box.x0, box.y0) and self.room.contains(box.x1, box.y1)
        return (1000 * (box.count_overlaps(self.boxes) + (not inside)) + 30 * box.padded(3).count_contains(self.dots)
                + 4 * box.count_contains(self.lines))


def _text(axes: Axes, words: str, at: tuple[float, float], **font: Any) -> Annotation:
    return axes.annotate(words, at, (0, 0), textcoords="offset points", va="center", zorder=9, linespacing=1.05,
                         annotation_clip=False,
                         bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6}, **font)


SLOPES = {-0.5: "−½", -1.0: "−1"}  # of noise alone: of errors that grow with its size, and with its square
LINEAR = (SMAPE, FLIP)
NOISE = "#ececec"
TICKS = (1, 2, 5)
MOST_TICKS = 8


def cost_axis(axes: Axes, low: float, high: float, seconds: bool) -> None:
    """Set a logarithmic axis of seconds, or of rays per finished pixel."""
    if seconds:
        time_axis(axes, low, high)
        return
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    powers = range(math.floor(math.log2(low)), math.ceil(math.log2(high)) + 1)
    ticks = [2.0**power for power in powers if power % 2 == 0 and low <= 2.0**power <= high]
    axes.set_xticks(ticks, [f"{tick:g}" if tick >= 1 else f"1/{1 / tick:.0f}" for tick in ticks])
    axes.set_xticks([], minor=True)


def error_axis(axes: Axes, low: float, high: float) -> None:
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
        axes.plot([start[0], end], [start[1], start[1] * (end / start[0])**slope], color=QUIET, linewidth=1.1,
                  linestyle=(0, (1.3, 2.7)), zorder=2.2)
        at = start[0] * (end / start[0])**0.93
        names.append(axes.annotate(f"slope {SLOPES[slope]}", (at, start[1] * (at / start[0])**slope), (3, 4),
                                   textcoords="offset points", fontsize=10.5, color=QUIET, zorder=8))
    return names


def draw_noise(axes: Axes, noise: float) -> list[Any]:
    """Shade the errors below the reference's own, and return the words there; none where it lies below the panel."""
    bottom = axes.get_ylim()[0]
    if noise <= bottom:
        return []
    axes.axhspan(bottom, noise, color=NOISE, zorder=1)
    return [axes.annotate("the reference's own noise", (0, noise), (3, -4), va="top", textcoords="offset points",
                          xycoords=("axes fraction", "data"), fontsize=10.5, color=QUIET, zorder=8)]


def limits(values: Sequence[float], room: float) -> tuple[float, float]:
    """Return the ends of a logarithmic axis of ``values`` above 0, with ``room`` of its length beyond each end."""
    low, high = math.log(min(values)), math.log(max(values))
    space = room * max(high - low, 0.5)
    return math.exp(low - space), math.exp(high + space)
