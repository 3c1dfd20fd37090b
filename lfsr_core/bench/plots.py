"""One panel of the chart as SVG: time on a logarithmic axis, accuracy on one that stretches towards 1.

What separates good methods is what they still miss, so equal steps up halve (or double) 1 − SSIM.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from html import escape

from lfsr_core.bench.chart.analysis import Point

WIDTH, HEIGHT = 540, 430
LEFT, RIGHT, TOP, BOTTOM = 52, 100, 40, 46  # margins; the right one takes the names of the curves
INK, FAINT, GRID, FRONT = "#222", "#b8b8b8", "#e6e6e6", "#f3dfa2"
LINE_HEIGHT, CHARACTER = 14, 8.0  # of a curve's name, in pixels
NAME_LENGTH = 13  # longer names break at a plus
TICK_STEPS = (1, 2, 5)
LEAST_X_TICKS, MOST_X_TICKS, MOST_Y_TICKS = 3, 7, 12
TICKS_TOWARD_ONE = (-1.0, 0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.75, 0.8, 0.85, 0.9, 0.92, 0.94, 0.95, 0.96, 0.97, 0.98,
                    0.99, 0.995, 0.998, 0.999)
WIDE_TICKS = (-1.0, 0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.998, 0.999)
SHIFTS = [step * 7 * sign for step in range(12) for sign in (1, -1)]  # of a name, in pixels
LEAST_MISSING = 5e-4  # 1 − value: split SSIM can come out at 1 or a little above


@dataclasses.dataclass(frozen=True)
class Curve:
    """One method: ``points`` by samples; ``half_widths`` of their values and ``spans`` (least, most) of their seconds.

    ``marker`` is one of MARKERS, so that a reader need not tell colours apart. ``counted``: sample counts are written.
    """

    name: str
    color: str
    marker: str
    points: Sequence[Point]
    half_widths: Sequence[float | None] = ()
    spans: Sequence[tuple[float, float]] = ()
    counted: bool = False
    bold: bool = False


@dataclasses.dataclass(frozen=True)
class Panel:
    """What one panel shows; ``ceiling`` (value, words) is a line across, ``others`` faint points without a name.

    ``toward_one``: values end at 1, and their axis stretches towards it.
    """

    title: str
    axis: str
    curves: Sequence[Curve]
    front: Sequence[Point]
    others: Sequence[Point] = ()
    ceiling: tuple[float, str] | None = None
    toward_one: bool = True


MARKERS = {
    "circle": '<circle r="5"/>', "square": '<rect x="-4.5" y="-4.5" width="9" height="9"/>',
    "triangle": '<path d="M0-6 5.5 4.5H-5.5Z"/>', "diamond": '<path d="M0-6.5 5.5 0 0 6.5-5.5 0Z"/>',
    "cross": '<path d="M-4.5-4.5 4.5 4.5M4.5-4.5-4.5 4.5" fill="none" stroke-width="2.5"/>',
    "ring": '<circle r="4.5" fill="#fff" stroke-width="2.5"/>', "down": '<path d="M0 6 5.5-4.5H-5.5Z"/>',
}


@dataclasses.dataclass(frozen=True)
class Axes:
    """From seconds and values to pixels of the panel; ``heights`` are values as ``height`` gives them."""

    seconds: tuple[float, float]
    heights: tuple[float, float]
    toward_one: bool

    def x(self, seconds: float) -> float:
        """Pixel column."""
        low, high = map(math.log, self.seconds)
        return round(LEFT + (math.log(seconds) - low) / (high - low) * (WIDTH - LEFT - RIGHT), 1)

    def y(self, value: float) -> float:
        """Pixel row, kept inside the panel."""
        low, high = self.heights
        part = min(max((height(value, self.toward_one) - low) / (high - low), 0), 1)
        return round(HEIGHT - BOTTOM - part * (HEIGHT - TOP - BOTTOM), 1)

    def shows(self, point: Point) -> bool:
        """True if the point lies inside."""
        inside = self.seconds[0] <= point.seconds <= self.seconds[1]
        return inside and self.heights[0] <= height(point.value, self.toward_one) <= self.heights[1]

    def at(self, point: Point) -> tuple[float, float]:
        """Pixel (column, row)."""
        return self.x(point.seconds), self.y(point.value)


def height(value: float, toward_one: bool) -> float:
    """A value as it stands on its axis: itself, or how often 1 − value was halved."""
    return -math.log2(max(1 - value, LEAST_MISSING)) if toward_one else value


def panel_svg(panel: Panel, x: int = 0, y: int = 0) -> str:
    """An <svg> element of WIDTH × HEIGHT at (x, y) of whatever it stands in; it scales with its box."""
    axes = _axes(panel)
    body = [*_grid(axes, panel), *_front(axes, panel.front), *_others(axes, panel.others), *_ceiling(axes, panel)]
    for curve in reversed(panel.curves):  # the first comes on top
        body += _curve(axes, curve)
    body += _names(axes, panel.curves)
    return (f'<svg xmlns="http://www.w3.org/2000/svg" x="{x}" y="{y}" width="{WIDTH}" height="{HEIGHT}" '
            f'viewBox="0 0 {WIDTH} {HEIGHT}" role="img" font-family="system-ui,sans-serif" font-size="13" '
            f'fill="{INK}"><title>{escape(panel.title)}</title>{"".join(body)}</svg>')


def time_text(seconds: float) -> str:
    """Seconds as a person would say them."""
    if seconds >= 3600:
        return f"{seconds / 3600:.3g} h"
    if seconds >= 180:
        return f"{seconds / 60:.2g} min"
    return f"{seconds:.3g} s" if seconds < 10 else f"{seconds:.0f} s"


def _axes(panel: Panel) -> Axes:
    shown = [point for curve in panel.curves for point in curve.points] + list(panel.front)
    seconds = [point.seconds for point in shown]
    values = [point.value for point in shown] + ([panel.ceiling[0]] if panel.ceiling else [])
    heights = [height(value, panel.toward_one) for value in values]
    room = max(max(heights) - min(heights), 1e-3) * 0.05
    return Axes((min(seconds) / 1.15, max(seconds) * 1.15), (min(heights) - room, max(heights) + 1.6 * room),
                panel.toward_one)


def _grid(axes: Axes, panel: Panel) -> Iterator[str]:
    bottom = HEIGHT - BOTTOM
    yield f'<text x="{LEFT}" y="20" font-size="16" font-weight="600">{escape(panel.title)}</text>'
    for seconds in time_ticks(*axes.seconds):
        x = axes.x(seconds)
        yield f'<path d="M{x} {TOP}V{bottom}" stroke="{GRID}"/>'
        yield f'<text x="{x}" y="{bottom + 17}" text-anchor="middle">{time_text(seconds)}</text>'
    for value, text in value_ticks(*axes.heights, axes.toward_one):
        y = axes.y(value)
        yield f'<path d="M{LEFT} {y}H{WIDTH - RIGHT}" stroke="{GRID}"/>'
        yield f'<text x="{LEFT - 6}" y="{y + 4}" text-anchor="end">{text}</text>'
    yield f'<text x="{LEFT}" y="35" font-size="12" fill="#555">↑ {escape(panel.axis)}</text>'
    yield (f'<text x="{WIDTH - RIGHT}" y="{HEIGHT - 10}" font-size="12" fill="#555" text-anchor="end">'
           'render and second stage, end to end →</text>')


def time_ticks(low: float, high: float) -> list[float]:
    """Round seconds between ``low`` and ``high``, few enough to be read; in even steps where 1-2-5 gives too few."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for steps in (TICK_STEPS, (1, 3), (1,)):
        ticks = [step * 10.0**power for power in decades for step in steps]
        ticks = [tick for tick in ticks if low <= tick <= high]
        if len(ticks) <= MOST_X_TICKS:
            break
    return ticks if len(ticks) >= LEAST_X_TICKS else even_ticks(low, high)


def even_ticks(low: float, high: float) -> list[float]:
    """Three to eight multiples of 1, 2 or 5 times a power of ten between ``low`` and ``high``."""
    power = 10.0 ** math.floor(math.log10((high - low) / 3))
    step = next(step * power for step in (5, 2, 1) if (high - low) / (step * power) >= 3 or step == 1)
    return [index * step for index in range(math.ceil(low / step), math.floor(high / step) + 1)]


def value_ticks(low: float, high: float, toward_one: bool) -> list[tuple[float, str]]:
    """Round values between heights ``low`` and ``high``, with their text."""
    if not toward_one:
        return [(tick, f"{tick:.4g}") for tick in even_ticks(low, high)]
    known = [tick for tick in TICKS_TOWARD_ONE if low <= height(tick, True) <= high]
    known = [tick for tick in known if tick in WIDE_TICKS] if len(known) > MOST_Y_TICKS else known
    return [(tick, f"{tick:g}") for tick in known]


def _front(axes: Axes, front: Sequence[Point]) -> Iterator[str]:
    if not front:
        return
    steps = "".join(f"H{axes.x(point.seconds)}V{axes.y(point.value)}" for point in front[1:])
    x, y = axes.at(front[0])
    yield (f'<path d="M{x} {y}{steps}H{WIDTH - RIGHT}" fill="none" stroke="{FRONT}" stroke-width="9" '
           'stroke-linejoin="round"/>')


def _others(axes: Axes, others: Sequence[Point]) -> Iterator[str]:
    for point in others:
        if axes.shows(point):
            x, y = axes.at(point)
            yield (f'<circle cx="{x}" cy="{y}" r="2.5" fill="{FAINT}"><title>{escape(point.method)}, {point.samples} '
                   f'samples: {time_text(point.seconds)}, {point.value:.4g}</title></circle>')


def _ceiling(axes: Axes, panel: Panel) -> Iterator[str]:
    if panel.ceiling:
        value, words = panel.ceiling
        y = axes.y(value)
        yield f'<path d="M{LEFT} {y}H{WIDTH - RIGHT}" stroke="{INK}" stroke-width="1.5" stroke-dasharray="2 4"/>'
        yield _halo(LEFT + 2, y - 5, words, size=11.5)


def _curve(axes: Axes, curve: Curve) -> Iterator[str]:
    at = [axes.at(point) for point in curve.points]
    path = "L".join(f"{x} {y}" for x, y in at)
    yield (f'<path d="M{path}" fill="none" stroke="{curve.color}" stroke-width="{3 if curve.bold else 1.8}" '
           'stroke-linejoin="round"/>')
    for (x, _), point, half in zip(at, curve.points, curve.half_widths, strict=False):
        if half:
            yield (f'<path d="M{x} {axes.y(point.value - half)}V{axes.y(point.value + half)}" stroke="{curve.color}" '
                   'stroke-width="1.2" opacity=".6"/>')
    for (_, y), (least, most) in zip(at, curve.spans, strict=False):
        if axes.seconds[0] < least < most < axes.seconds[1]:
            yield f'<path d="M{axes.x(least)} {y}H{axes.x(most)}" stroke="{curve.color}" stroke-width="1.2"/>'
    for (x, y), point in zip(at, curve.points, strict=True):
        yield (f'<g transform="translate({x} {y})" fill="{curve.color}" stroke="{curve.color}">{MARKERS[curve.marker]}'
               f'<title>{escape(curve.name)}, {point.samples} samples: {time_text(point.seconds)}, {point.value:.4g}'
               "</title></g>")
        if curve.counted:
            yield _halo(x - 7, y - 7, str(point.samples), size=11, color=curve.color, anchor="end")


def _names(axes: Axes, curves: Sequence[Curve]) -> Iterator[str]:
    """Names beside the last points, moved up or down to where they hide least."""
    names: list[Box] = []
    dots = [_around(*axes.at(point)) for curve in curves for point in curve.points]
    for curve in sorted(curves, key=lambda curve: -curve.points[-1].value):
        x, y = axes.at(curve.points[-1])
        lines = broken(curve.name, WIDTH - 2 - x - 10)
        width, tall = CHARACTER * max(map(len, lines)), LINE_HEIGHT * len(lines)
        left = min(x + 10, WIDTH - 2 - width)
        start = Box(left, y - tall / 2, left + width, y + tall / 2)
        box = min((start.moved(shift) for shift in SHIFTS), key=lambda box: _hidden(box, names, dots, start))
        names.append(box)
        if abs(box.top - start.top) > LINE_HEIGHT:
            yield (f'<path d="M{x} {y}L{left - 2} {box.top + tall / 2:.1f}" stroke="{curve.color}" '
                   'stroke-width="1" stroke-dasharray="2 2"/>')
        for index, line in enumerate(lines):
            yield _halo(left, box.top + LINE_HEIGHT * (index + 1) - 3, line, curve.color, weight=600)


@dataclasses.dataclass(frozen=True)
class Box:
    """Pixels that something covers."""

    left: float
    top: float
    right: float
    bottom: float

    def moved(self, down: float) -> Box:
        """The same further down."""
        return Box(self.left, self.top + down, self.right, self.bottom + down)

    def meets(self, other: Box) -> bool:
        """True if both cover a pixel."""
        return (self.left < other.right and other.left < self.right
                and self.top < other.bottom and other.top < self.bottom)


def _around(x: float, y: float) -> Box:
    return Box(x - 5, y - 5, x + 5, y + 5)


def _hidden(box: Box, names: Sequence[Box], dots: Sequence[Box], wanted: Box) -> float:
    """How bad a place for a name is: other names weigh most, then points, then the way from where it belongs."""
    outside = box.top < 0 or box.bottom > HEIGHT - BOTTOM
    return (1000 * (outside + sum(box.meets(name) for name in names)) + 30 * sum(box.meets(dot) for dot in dots)
            + abs(box.top - wanted.top))


def broken(name: str, room: float = 0) -> list[str]:
    """A name in lines of about NAME_LENGTH, broken before a plus or at a blank; whole if ``room`` pixels hold it."""
    if len(name) * CHARACTER <= room:
        return [name]
    lines = [""]
    for word in name.replace("+", " +").split(" "):
        glue = "" if word.startswith("+") and not name.count(" ") else " "
        if lines[-1] and len(lines[-1] + glue + word) > NAME_LENGTH:
            lines.append(word)
        else:
            lines[-1] += (glue if lines[-1] else "") + word
    return lines


def _halo(x: float, y: float, words: str, color: str = INK, size: float = 13, weight: int = 400,
          anchor: str = "start") -> str:
    return (f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{size}" font-weight="{weight}" '
            f'fill="{color}" stroke="#fff" stroke-width="3.5" paint-order="stroke" stroke-linejoin="round">'
            f"{escape(words)}</text>")
