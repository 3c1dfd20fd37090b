"""Read a photograph of the phase pattern and find the panel in it: which place shows which point of the panel.

The outline of the lit area gives a first guess; the light and dark dots tell whether it is turned or mirrored. The
whole channel of the dots is then fitted at once: a homography, the lens's distortion, and slowly changing brightness.
Places in a photograph count from its middle, rightwards and downwards, in halves of its diagonal.
"""

import dataclasses
import math
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
import OpenImageIO as oiio
from numpy.polynomial import legendre

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import reading
from lfsr_core.calibration.patterns import DOT_CHANNEL, FRINGE_CHANNELS, Dots, dots
from lfsr_core.images.image_files import opened, upright
from lfsr_core.optics.display import DisplayProfile

# Of the file.
MOST_PIXELS = 120_000_000
LONGER_SIDE = 4200  # pixels that are enough; larger photographs are averaged down
WHITE = {"uint8": 255.0, "uint16": 65535.0}
# Of the outline.
SMALL = 240  # pixels of the longer side in which the panel is looked for
LIT = 0.4  # of the light of the photograph's middle
MIN_SIDE = 100  # pixels of the panel's shortest side
MIN_PICTURE = 200  # of the photograph's shorter side
CLIPPED, MOST_CLIPPED = 0.985, 0.06  # value of a saturated channel, and how much of the panel may be that bright
LEAST_LIGHT, LEAST_COLOR = 0.15, 0.08  # of the brightest 5 %; difference of the channels, divided by their mean
ANGLES = 24  # directions in a quarter turn along which corners are looked for
# Of the fit.
GAMMA = 2.2  # of panels and photographs: the colours that a camera mixes add up in linear light
MARGIN = 0.94  # fraction of the panel's width and height that is measured
COARSE, FINE = 110, 200  # points across that are compared with the dots
COARSE_SPREAD = 1.5  # factor that widens the dots in the first rounds
ROUNDS, STILL = 15, 1e-4  # most rounds of a fit, and pixels of movement that end it
GAIN, OFFSET = 4, 5  # terms per axis of the brightness of dots, and of what lies under them
LEAST_ALIKE, LEAST_APART = 0.3, 0.1  # correlation with the dots, and its lead over the other seven orientations


def read_photograph(path: str | Path) -> Array:
    """Return a photograph as float32 (H, W, 3) from 0 to 1, turned and mirrored back as its EXIF orientation says.

    LfsrError if it cannot be read, has no colours or is too large.
    """
    with reading(path, "a photograph"):
        pass
    with opened(path) as source:
        spec = source.spec() if source else None
        if spec is not None:
            if spec.width * spec.height > MOST_PIXELS:
                raise LfsrError(f"{path} has {spec.width}×{spec.height} pixels, but a photograph may have "
                                f"{MOST_PIXELS // 1_000_000} million: make it smaller")
            if spec.nchannels < 3:
                raise LfsrError(f"{path} has no colours, but the pattern's channels are measured one by one: "
                                "photograph in colour")
        kind = "uint8" if spec is not None and str(spec.format) == "uint8" else "uint16"
        pixels = source.read_image(0, 0, 0, 3, kind) if source else None
        problem = source.geterror() if source else oiio.geterror()
    if spec is None or pixels is None or problem:
        line = problem.strip().partition("\n")[0].rpartition(":")[2].strip()[:80]  # of the library, without paths
        raise LfsrError(f"{path} cannot be read as a photograph{f' ({line})' if line else ''}: save it as JPEG or PNG, "
                        "or take it again")
    image = upright(np.asarray(pixels), spec)
    if (times := -(-max(image.shape) // LONGER_SIDE)) == 1:
        return np.ascontiguousarray(image, np.float32) / np.float32(WHITE[kind])
    # Means of times × times pixels.
    rows, columns = (count // times * times for count in image.shape[:2])
    total = np.zeros((rows // times, columns // times, image.shape[2]), np.float32)
    for number in range(times ** 2):
        total += image[number // times:rows:times, number % times:columns:times]
    return total / times ** 2 / np.float32(WHITE[kind])


class Raster(NamedTuple):
    """A photograph, or one averaged down."""

    values: Array  # (H, W, …)
    middle: Array  # (column, row) of the photograph's middle
    half: float  # of its diagonal, in pixels

    @classmethod
    def of(cls, image: Array) -> Self:
        """A photograph (H, W, …) as it is."""
        height, width = image.shape[:2]
        return cls(image, np.array([width - 1, height - 1]) / 2, math.hypot(height, width) / 2)

    def at(self, places: Array) -> Array:
        """Values at places (…, 2), bilinear; 0 outside."""
        height, width = self.values.shape[:2]
        spot = places * self.half + self.middle
        left, top = np.moveaxis(np.floor(spot).astype(int), -1, 0)
        inside = (left >= 0) & (top >= 0) & (left < width - 1) & (top < height - 1)
        left, top = np.clip(left, 0, width - 2), np.clip(top, 0, height - 2)
        across, down, there = np.stack([spot[..., 0] - left, spot[..., 1] - top, inside]).reshape(
            3, *inside.shape, *[1] * (self.values.ndim - 2))
        upper = self.values[top, left] * (1 - across) + self.values[top, left + 1] * across
        lower = self.values[top + 1, left] * (1 - across) + self.values[top + 1, left + 1] * across
        return np.asarray((upper * (1 - down) + lower * down) * there)

    def shrunk(self, times: int) -> Self:
        """A raster whose pixels are means of ``times`` × ``times``."""
        if times <= 1:
            return self
        rows, columns = (count // times for count in self.values.shape[:2])
        part = self.values[:rows * times, :columns * times]
        means = part.reshape(rows, times, columns, times, *self.values.shape[2:]).mean((1, 3))
        return type(self)(means, (self.middle + 0.5) / times - 0.5, self.half / times)


@dataclasses.dataclass(frozen=True)
class View:
    """How a photograph shows the panel."""

    matrix: Array  # (3, 3) homography from millimetres on the panel, y up, to places without distortion
    # Distortion: places times (1 + a r² + b r⁴), and, where the lens is not in front of the middle, c and d times
    # (r² + 2 x², 2 x y) and (2 x y, r² + 2 y²).
    bend: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    alike: float = 0.0  # correlation of their channel with the dots
    offsets: Array = dataclasses.field(default_factory=lambda: np.zeros((0, 2)))  # (n, 2) of dots from the fit, in mm

    def places(self, points: Array) -> Array:
        """Places (…, 2) in the photograph of points (…, 2) of the panel."""
        straight = project(self.matrix, points)
        square = straight[..., :1] ** 2 + straight[..., 1:] ** 2
        (a, b), off = self.bend[:2], np.array(self.bend[2:])
        return np.asarray(straight * (1 + a * square + b * square ** 2 + 2 * straight @ off[:, None]) + square * off)

    @property
    def mirrored(self) -> bool:
        """Whether the photograph shows the panel mirrored."""
        return bool(np.linalg.det(self.matrix) > 0)  # y is up on the panel and down in the photograph

    @property
    def turn_deg(self) -> int:
        """Quarter turns, in degrees clockwise, by which the photograph shows the panel."""
        start, end = self.places(np.array([[0.0, 0.0], [1.0, 0.0]]))
        right = start - end if self.mirrored else end - start
        return round(math.degrees(math.atan2(right[1], right[0])) / 90) % 4 * 90

    def camera(self, height: float) -> Array:
        """Return the camera's (x, y), in millimetres on the panel, from the perspective; ``height``: its z, above 0."""
        low, high = math.log(0.05), math.log(100.0)
        for _ in range(60):
            middle = (low + high) / 2
            focal = math.exp(middle)  # in halves of the photograph's diagonal
            turned: Array = np.diag([1 / focal, 1 / focal, 1]) @ self.matrix
            turned /= math.sqrt(np.linalg.norm(turned[:, 0]) * np.linalg.norm(turned[:, 1]))
            right, up, away = turned.T
            low, high = (middle, high) if abs(np.cross(right, up) @ away) < height else (low, middle)
        return np.array([-right @ away, -up @ away])

    @property
    def bent(self) -> float:
        """Distortion at the photograph's corner."""
        return self.bend[0] + self.bend[1]


def find_panel(image: Array, profile: DisplayProfile) -> View:
    """Return how a photograph (H, W, 3) shows the panel with the phase pattern of ``profile``.

    LfsrError if no panel or no dots are found.
    """
    corners, halves = _outline(image), np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]]) / 2
    whole, marks, size = Raster.of(image), dots(profile), np.array(profile.panel_mm)
    shown = whole.at(project(fit_homography(halves, corners), grid(np.ones(2), COARSE)))
    if (clipped := float((shown >= CLIPPED).mean((0, 1)).max())) > MOST_CLIPPED:
        raise LfsrError(f"the photograph is overexposed ({clipped:.0%} of the panel is white in a channel): touch the "
                        "panel on the telephone's screen, pull the brightness down and take it again")
    if np.percentile(shown.max(-1), 95) < LEAST_LIGHT:
        raise LfsrError("the photograph is too dark: make the panel brighter, or expose longer, and take it again")
    if np.ptp(shown, axis=-1).mean() < LEAST_COLOR * shown.mean():
        raise LfsrError("the photograph has no colours, but the pattern's channels are measured one by one: switch "
                        "filters off and photograph in colour")

    # Try the panel in eight orientations between the corners, and keep the one that fits the dots best.
    light = whole._replace(values=image ** GAMMA)
    small, points = light.shrunk(round(_sides(corners).mean() * light.half / COARSE)), grid(size, COARSE)
    expected = marks.shown(points[:1, :, 0], points[:, :1, 1], marks.spread * COARSE_SPREAD) ** GAMMA
    flat, alike = _terms(points, size, OFFSET), []
    views = [View(fit_homography(halves * size, np.roll(corners[::way], turn, 0)))
             for way in (1, -1) for turn in range(4)]
    for view in views:
        both = np.stack([small.at(view.places(points))[..., DOT_CHANNEL].ravel(), expected.ravel()], -1)
        rest = both - flat @ _solved(flat, both)
        alike.append(float((rest[:, 0] * rest[:, 1]).sum() / max(math.sqrt((rest ** 2).sum(0).prod()), 1e-12)))
    best, second = np.sort(alike)[:-3:-1]
    if not (best >= LEAST_ALIKE and best - second >= LEAST_APART):
        raise LfsrError(f"the pattern's dots are not recognised (agreement {max(best, 0):.0%}, {max(second, 0):.0%} "
                        "when turned): photograph the whole panel, sharp, showing nothing but the phase pattern of "
                        "this version")

    view = _align(views[int(np.argmax(alike))], small, marks, size, COARSE, COARSE_SPREAD, False)
    view = _align(view, small, marks, size, COARSE, COARSE_SPREAD, True)
    # Blurred a little, because fine colour moiré looks like colours that mix.
    fine = light.shrunk(round(_sides(view.places(halves * size)).mean() * light.half / FINE))
    soft = fine.values
    for axis in (0, 1, 0, 1):
        ends = np.pad(soft, [(1, 1) if number == axis else (0, 0) for number in range(3)], mode="edge")
        parts = [np.take(ends, np.arange(soft.shape[axis]) + step, axis) for step in range(3)]
        soft = parts[0] / 4 + parts[1] / 2 + parts[2] / 4
    view = _align(view, fine._replace(values=soft), marks, size, FINE, 1.0, True)
    if not view.alike >= 0.75 or abs(view.bent) > 0.3:
        raise LfsrError(f"the pattern's dots are not seen clearly (agreement {max(view.alike, 0):.0%}): photograph the "
                        "whole panel, sharp, showing nothing but the phase pattern 1:1")
    return view


def project(matrix: Array, points: Array) -> Array:
    """(…, 2) points mapped by a homography."""
    x, y = points[..., 0], points[..., 1]
    scaled = [matrix[n, 0] * x + matrix[n, 1] * y + matrix[n, 2] for n in range(3)]
    return np.stack([scaled[0] / scaled[2], scaled[1] / scaled[2]], -1)


def fit_homography(points: Array, images: Array) -> Array:
    """Return the homography (3, 3) that maps (n, 2) ``points`` closest to ``images``, for 4 points or more."""
    # Homographies that move points to the origin and scale them to a size of about 1.
    moves = []
    for places in (points, images):
        middle, size = places.mean(0), max(float(places.std()), 1e-12)
        moves.append(np.array([[1 / size, 0, -middle[0] / size], [0, 1 / size, -middle[1] / size], [0, 0, 1.0]]))
    before, after = moves
    x, y = project(before, points).T
    u, v = project(after, images).T
    one, none = np.ones_like(x), np.zeros_like(x)
    rows = np.concatenate([np.stack([x, y, one, none, none, none, -u * x, -u * y, -u], -1),
                           np.stack([none, none, none, x, y, one, -v * x, -v * y, -v], -1)])
    result: Array = np.linalg.inv(after) @ np.linalg.svd(rows)[2][-1].reshape(3, 3) @ before
    return np.divide(result, result[2, 2])


def grid(size: Array, across: int) -> Array:
    """Points (rows, ``across``, 2) of the measured part of a panel, rows from the top."""
    x, y = (((np.arange(count) + 0.5) / count - 0.5) * length * MARGIN
            for count, length in ((across, size[0]), (max(2, round(across * size[1] / size[0])), size[1])))
    return np.stack(np.meshgrid(x, -y), -1)


def _sides(corners: Array) -> Array:
    """Lengths (4,) of the sides of a quadrangle of places."""
    return np.asarray(np.linalg.norm(corners - np.roll(corners, 1, 0), axis=1))


def _outline(image: Array) -> Array:
    """The corners (4, 2) of the lit quadrangle in the middle of a photograph (H, W, 3), clockwise, as places.

    LfsrError if nothing is lit there, or it is too small.
    """
    height, width = image.shape[:2]
    if min(height, width) < MIN_PICTURE:
        raise LfsrError(f"the photograph has {width}×{height} pixels, but its shorter side needs at least "
                        f"{MIN_PICTURE}: send the original, not a preview")
    step = max(1, math.ceil(max(height, width) / SMALL))
    rows, columns = (np.arange(step // 2, count, step) for count in (height, width))
    padded = np.pad(image[np.ix_(rows, columns)].max(-1), 1, mode="edge")
    high, wide = len(rows), len(columns)
    light = np.asarray(sum(padded[y:y + high, x:x + wide] for y in range(3) for x in range(3)) / 9)
    middle = np.s_[high * 2 // 5:high * 3 // 5 + 1, wide * 2 // 5:wide * 3 // 5 + 1]
    brightness = float(np.median(light[middle]))
    lit = light > LIT * brightness
    part = np.zeros_like(lit)  # the lit pixels that are connected to the middle
    part[middle] = lit[middle]
    count = -1
    while count != (count := int(part.sum())):
        for _ in range(8):
            grown = np.pad(part, 1)
            part = lit & (grown[1:-1, 1:-1] | grown[:-2, 1:-1] | grown[2:, 1:-1] | grown[1:-1, :-2] | grown[1:-1, 2:])
    row, column = np.nonzero(part)
    if brightness < 0.02 or len(row) < lit.size / 100:
        raise LfsrError("no lit panel is seen in the photograph: photograph the phase pattern in a dark room, with the "
                        "panel in the middle of the image")
    # The largest quadrangle whose corners are the farthest points in four perpendicular directions.
    points, best = np.stack([columns[column], rows[row]], -1).astype(float), -1.0
    for angle in np.arange(ANGLES) * math.pi / 2 / ANGLES:
        ways = angle + np.arange(4) * math.pi / 2
        ends = points[(points @ np.stack([np.cos(ways), np.sin(ways)])).argmax(0)]
        x, y = ends.T
        if (area := float(abs((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()))) > best:
            best, outline = area, ends
    corners = np.asarray((outline - [(width - 1) / 2, (height - 1) / 2]) / (math.hypot(height, width) / 2))
    if (side := float(_sides(corners).min()) * math.hypot(height, width) / 2) < MIN_SIDE:
        raise LfsrError(f"the panel's shortest side is {side:.0f} pixels in the photograph, but at least {MIN_SIDE} "
                        "are needed: come nearer, or use a longer lens from the same place")
    return corners


def _align(view: View, image: Raster, marks: Dots, size: Array, across: int, wider: float, bend: bool) -> View:
    """The view that explains the dots' channel best, beginning with ``view``; with distortion if ``bend``."""
    points = grid(size, across)
    axes = points[:, 0, 1], points[0, :, 0]
    spread = marks.spread * wider
    light, wide = (marks.shown(points[:1, :, 0], points[:, :1, 1], width).ravel() ** GAMMA
                   for width in (spread, spread * 1.1))
    under = _terms(points, size, OFFSET)
    columns = np.concatenate([under, _terms(points, size, GAIN) * light[:, None], (wide - light)[:, None]], -1)
    for _ in range(ROUNDS):
        places = view.places(points)
        colors = image.at(places).reshape(-1, 3)
        # The camera mixes colours, so the fringes' channels are terms too.
        seen, others = colors[:, DOT_CHANNEL], colors[:, FRINGE_CHANNELS]
        terms = np.concatenate([columns, others], -1)
        fitted = terms @ _solved(terms, seen) - under @ _solved(under, seen)
        # How the light changes with each number of the view: by the slopes of the fitted image, because those of the
        # photograph would contain its noise. Slopes along points become slopes along places by the inverse of the
        # derivative of places by points.
        slope = np.einsum("...i,...ij->...j", np.stack(np.gradient(fitted.reshape(points.shape[:2]), *axes)[::-1], -1),
                          np.linalg.inv(np.stack(np.gradient(places, *axes, axis=(0, 1))[::-1], -1)))
        changes = [np.einsum("...i,...i", _moved(view, delta, size, bend).places(points) - places, slope).ravel() / 1e-5
                   for delta in 1e-5 * np.eye(12 if bend else 8)]
        solved = _solved(np.concatenate([terms, -np.stack(changes, -1)], -1), seen)
        moved = _moved(view, solved[terms.shape[1]:], size, bend)
        step, view = np.abs(moved.places(points) - places).max() * image.half, moved
        if not step < 1e3 or step < STILL:
            break
    rest, flat = seen - terms @ solved[:terms.shape[1]], np.concatenate([under, others], -1)
    plain: Array = seen - flat @ _solved(flat, seen)
    alike = math.sqrt(max(0.0, 1 - float((rest ** 2).sum() / max((plain ** 2).sum(), 1e-12))))
    gain = columns[:, under.shape[1]:-1] @ solved[under.shape[1]:columns.shape[1] - 1]
    # Offset of each dot from the fit, in millimetres.
    rest, gain = (values.reshape(points.shape[:2]) for values in (rest, gain))
    up, right = (np.gradient(gain, places, axis=axis) for axis, places in enumerate(axes))
    offsets = []
    for y in marks.y:
        for x in marks.x:
            part = np.ix_(np.abs(axes[0] - y) < 2.5 * marks.spread, np.abs(axes[1] - x) < 2.5 * marks.spread)
            terms = np.stack([np.ones_like(gain[part]), -right[part], -up[part], gain[part]], -1).reshape(-1, 4)
            offsets.append(_solved(terms, rest[part].ravel())[1:3])
    return dataclasses.replace(view, alike=alike, offsets=np.array(offsets))


def _moved(view: View, delta: Array, size: Array, bend: bool) -> View:
    """The view with its numbers changed: those of the matrix count in halves of the panel's size."""
    matrix = view.matrix + np.append(delta[:8], 0).reshape(3, 3) @ np.diag([2 / size[0], 2 / size[1], 1])
    bent = tuple(float(one + more) for one, more in zip(view.bend, delta[8:], strict=True)) if bend else view.bend
    return dataclasses.replace(view, matrix=matrix / matrix[2, 2], bend=bent)


def _terms(points: Array, size: Array, count: int) -> Array:
    """(n, terms) slowly changing functions of points, of degrees below ``count`` in all."""
    x, y = (points / size * 2 / MARGIN).reshape(-1, 2).T
    degrees = np.add.outer(np.arange(count), np.arange(count)).ravel()
    across, up = (legendre.legvander(place, count - 1) for place in (x, y))  # type: ignore[no-untyped-call]
    return np.asarray((across[:, :, None] * up[:, None]).reshape(len(x), -1)[:, degrees < count])


def _solved(terms: Array, values: Array) -> Array:
    """Return the least-squares factors of the columns of ``terms`` for ``values``."""
    scale = np.sqrt((terms ** 2).sum(0)) + 1e-12
    scaled = terms / scale
    return np.asarray((np.linalg.solve(scaled.T @ scaled + 1e-10 * np.eye(len(scale)), scaled.T @ values).T / scale).T)
