"""Detail that a method took for noise, found and added again along epipolar lines ("epi").

The residual, the render minus what a method made of it, should be noise, which no two pixels have in common. Detail
that was smoothed away is in the residual of every view that sees it: along a line of the epipolar-plane image whose
slope is the depth of the point (Bolles, Baker and Marimont, IJCV 1987). So the covariance of the residual along such
lines measures lost detail, and its mean along them is that detail with little noise. Adding it is one step of
iterative back-projection (Irani and Peleg, CVGIP 1991).
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.cores import usable_cores
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct.methods.denoise import Box
from lfsr_core.reconstruct.methods.interpolation import (
    EIS_IN_CACHE,
    KERNELS,
    averaged,
    decode,
    encode,
    finish_in_steps,
    interpolated,
    kernel_matrix,
)
from lfsr_core.reconstruct.upscaler import Upscaler

# (lenses, views) per step along a line: three usable depths on each side of the display plane. On the plane itself
# denoisers lose little, and their own traces would be taken for detail (docs/notebook/networks.md).
OFF_PLANE = ((1, 3), (1, 2), (2, 3), (1, 1), (3, 2), (2, 1), (5, 2), (3, 1))
LINES = (*OFF_PLANE, *((-lenses, views) for lenses, views in OFF_PLANE))
STEEPNESS = np.array([lenses / views for lenses, views in LINES])  # lenses per view
REACH = 2  # steps to each side of a pixel in its mean along a line, in rows and in columns
AVERAGED = 2 * REACH + 1
NEIGHBOURS = 2  # lenses to each side whose covariances are added
CERTAIN = 4.0  # standard deviations by which a covariance must exceed noise
LEAST_SAMPLES = 2  # per pixel: the noise of one is no normal distribution, and is taken for detail
LIMIT = 1.0  # of a residual, in encoded values: a firefly is no detail
DARK = 1e-3  # scene-linear value below which √x is taken for a line
STEEPEST = 1.0  # lenses per view up to which detail is interpolated inside an EI: on steeper lines a point skips lenses
KERNEL = "lanczos"  # for detail, which has no edges to ring at: see docs/notebook/networks.md
LENS_KERNEL = "cubic"  # across lenses, along a line
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
STEP, MAX_WORKERS = 24, 8


@dataclasses.dataclass(frozen=True, kw_only=True)
class RecoverableEIA(LowResEIA):
    """A low-resolution EIA with the detail that a method would lose in the ``covered`` lenses."""

    cleaned: Array  # what the method interpolates, (sy, sx, h, w, 3) encoded
    lost: Array  # detail missing in it, (sy, sx, h, w, 3) encoded
    line: Array  # index into LINES along which a lens lost most, (sy, sx) int
    covered: Array  # lenses where the foreground shows, (sy, sx) bool


class Recovering(Upscaler):
    """Interpolation by a kernel, and the detail which it and a denoiser before it lose.

    Lenses without foreground are only interpolated. ``block``: side of the square blocks of lenses that are not
    neighbours on the display, as the samples of a plan; None where all lenses are.
    """

    thread_safe = True

    def __init__(self, kernel: str, block: int | None = None) -> None:
        self._kernel, self._block = kernel, block

    def prepare(self, low: LowResEIA) -> RecoverableEIA:
        """Add the detail that interpolation would lose to ``low``."""
        covered = (low.alpha.max((2, 3, 4)) > 0) & (low.samples >= LEAST_SAMPLES)
        cleaned = _encoded_all(low.color, covered)
        lost, line = np.zeros_like(cleaned), np.zeros(covered.shape, int)
        for part in self._parts(covered):
            lost[part], line[part] = _lost_detail(low.rendered[part], cleaned[part], covered[part],
                                                  self._kernel, low.factors)
        found = {"cleaned": cleaned, "lost": lost, "line": line, "covered": covered}
        return RecoverableEIA(**vars(low) | found)

    def __call__(self, low: LowResEIA, lenses: Array) -> Array:
        """Finished EIs of ``lenses``; ``low`` is the result of ``prepare``."""
        assert isinstance(low, RecoverableEIA), "prepare comes first"
        return finish_in_steps(low, np.asarray(lenses), EIS_IN_CACHE, lambda part, _: self._encoded(low, part))

    def _encoded(self, low: RecoverableEIA, lenses: Array) -> Array:
        rows, columns = lenses.T
        cleaned, lost, rest = low.cleaned[rows, columns], low.lost[rows, columns], ~low.covered[rows, columns]
        if rest.any():
            cleaned[rest] = encode(low.color[rows[rest], columns[rest]])
        finished = interpolated(cleaned, self._kernel, low.factors)
        some, steep = lost.any((1, 2, 3)), STEEPNESS[low.line[rows, columns]]
        inside = some & (np.abs(steep) <= STEEPEST)
        if inside.any():
            finished[inside] += interpolated(lost[inside], KERNEL, low.factors)
        for slope in np.unique(steep[some & ~inside]):
            chosen = some & (steep == slope)
            finished[chosen] += sheared(low.lost, low.covered, lenses[chosen], low.factors, float(slope))
        return finished

    def _parts(self, covered: Array) -> list[Box]:
        """Rectangles of lenses with foreground that are not neighbours."""
        if self._block is None:
            return [_around(covered, 0)] if covered.any() else []
        starts = (range(0, size, self._block) for size in covered.shape)
        squares = ((slice(y, y + self._block), slice(x, x + self._block)) for y, x in itertools.product(*starts))
        return [square for square in squares if covered[square].any()]


def _encoded_all(color: Array, covered: Array) -> Array:
    """Encode the EIs of the ``covered`` lenses on every core; the others are 0."""
    lenses, encoded = np.argwhere(covered), np.zeros_like(color)

    def work(part: Array) -> None:
        encoded[part[:, 0], part[:, 1]] = encode(color[part[:, 0], part[:, 1]])

    with ThreadPoolExecutor(min(usable_cores(), MAX_WORKERS)) as pool:
        list(pool.map(work, [lenses[start:start + STEP] for start in range(0, len(lenses), STEP)]))
    return encoded


def _lost_detail(rendered: Array, cleaned: Array, covered: Array, kernel: str,
                 factors: tuple[int, int]) -> tuple[Array, Array]:
    """Encoded detail (sy, sx, h, w, 3) of ``rendered`` that interpolating ``cleaned`` loses, and its lines (sy, sx)."""
    shown = averaged(cleaned, kernel, factors)
    # Test the residual in linear light: the mean of noisy roots is too low, which would look like detail.
    fraction, line = lost_fraction(residual(rendered, decode(shown)) @ LUMINANCE * covered[:, :, None, None], covered)
    lost = np.zeros_like(cleaned)
    found = np.clip(encode(rendered) - shown, -LIMIT, LIMIT) * covered[:, :, None, None, None]
    for index in np.unique(line[fraction > 0]):
        chosen = (line == index) & (fraction > 0)
        part = _around(chosen, REACH * abs(LINES[index][0]))
        mean = _mean_along(found[part], covered[part], LINES[index])
        lost[part][chosen[part]] = mean[chosen[part]]
    # Wiener's weight: detail against the noise left in the mean, which was taken along axes with several views only.
    pixels = AVERAGED ** sum(size > 1 for size in rendered.shape[2:4])
    weight = np.divide(fraction, fraction + (1 - fraction) / pixels, out=np.zeros_like(fraction), where=fraction > 0)
    return lost * weight.astype(np.float32)[:, :, None, None, None], line


def residual(rendered: Array, shown: Array) -> Array:
    """Difference of two scene-linear images (…, 3), times the slope of ``encoding.encode``; at most LIMIT."""
    dark = np.maximum(shown, DARK)
    slope = np.float32(0.5) / np.where(dark < 1, np.sqrt(dark), dark)
    return np.asarray(np.clip((rendered - shown) * slope, -LIMIT, LIMIT))


def lost_fraction(found: Array, covered: Array) -> tuple[Array, Array]:
    """Fraction in [0, 1] of a residual's variance that is detail, and the index into LINES of its line; (sy, sx).

    ``found`` (sy, sx, h, w): luminance of the residual, 0 where ``covered`` (sy, sx) is False.
    """
    squares = found * found
    variance = _pooled(squares.sum((2, 3), dtype=float)) / np.maximum(_pooled(covered * float(found[0, 0].size)), 1)
    most, line = np.zeros(covered.shape), np.zeros(covered.shape, int)
    for index, step in enumerate(LINES):
        pairs = np.maximum(_pooled(_pairs(found.shape[2:], covered, step)), 1)
        products, spread = (_pooled(_products(values, step)) for values in (found, squares))
        # The products' own spread, as noise has heavy tails; a pair counts at both ends, so half are independent.
        detail = (products - CERTAIN * np.sqrt(2 * spread)) / pairs
        line[detail > most] = index
        most = np.maximum(most, detail)
    fraction = np.divide(most, variance, out=np.zeros_like(most), where=covered & (variance > 0))
    return np.clip(fraction, 0, 1), line


def _products(values: Array, step: tuple[int, int]) -> Array:
    """Sum over the pixels of each lens of their products with the pixels one ``step`` on and back; (sy, sx)."""
    sums = np.zeros(values.shape[:2])
    for axis in (0, 1):
        (here, there), (across, on) = _step(values.shape, axis, step)
        product = np.einsum("yxuv,yxuv->yx", values[here][across], values[there][on])
        sums[here] += product
        sums[there] += product
    return sums


def _pairs(views: tuple[int, ...], covered: Array, step: tuple[int, int]) -> Array:
    """Number of products that ``_products`` adds per lens where both lenses are ``covered``; (sy, sx)."""
    pairs = np.zeros(covered.shape)
    for axis in (0, 1):
        (here, there), _ = _step((*covered.shape, *views), axis, step)
        both = (covered[here] & covered[there]) * float(max(views[axis] - step[1], 0) * views[1 - axis])
        pairs[here] += both
        pairs[there] += both
    return pairs


def _mean_along(found: Array, covered: Array, step: tuple[int, int]) -> Array:
    """Mean over covered pixels up to REACH steps on and back, in rows and in columns: a patch of one point."""
    count = np.broadcast_to(covered[:, :, None, None, None], (*found.shape[:4], 1)).astype(np.float32)
    for axis in (0, 1):
        sums = found.copy(), count.copy()
        for steps in range(1, REACH + 1):
            (here, there), (across, on) = _step(found.shape, axis, (steps * step[0], steps * step[1]))
            for total, values in zip(sums, (found, count), strict=True):
                total[here][across] += values[there][on]
                total[there][on] += values[here][across]
        found, count = sums
    return np.asarray(found / np.maximum(count, 1))


Pair = tuple[tuple[slice, ...], tuple[slice, ...]]


def _step(shape: Sequence[int], axis: int, step: tuple[int, int]) -> tuple[Pair, Pair]:
    """Indices of lenses (sy, sx), and of pixels (…, …, h, w), that pair an array with itself one ``step`` on."""
    (here, there), views = _ends(shape, axis, step[0]), _ends(shape, axis + 2, step[1])
    return (here[:2], there[:2]), views


def _ends(shape: Sequence[int], axis: int, shift: int) -> Pair:
    """Indices of the first four axes that pair an array with itself ``shift`` on along one of them."""
    length = shape[axis]
    shift = max(-length, min(shift, length))
    first, second = [slice(None)] * 4, [slice(None)] * 4
    first[axis] = slice(max(0, -shift), length - max(0, shift))
    second[axis] = slice(max(0, shift), length - max(0, -shift))
    return tuple(first), tuple(second)


def _pooled(values: Array) -> Array:
    """Sums over each lens and its NEIGHBOURS."""
    for axis in (0, 1):
        padded = np.pad(values, [(NEIGHBOURS, NEIGHBOURS) if axis == n else (0, 0) for n in (0, 1)])
        values = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEIGHBOURS + 1, axis).sum(-1)
    return values


def _around(chosen: Array, margin: int) -> Box:
    """Rectangle of the chosen lenses with ``margin`` around."""
    rows, columns = (np.flatnonzero(chosen.any(axis)) for axis in (1, 0))
    return (slice(max(0, rows[0] - margin), rows[-1] + 1 + margin),
            slice(max(0, columns[0] - margin), columns[-1] + 1 + margin))


def sheared(images: Array, covered: Array, lenses: Array, factors: tuple[int, int], steep: float) -> Array:
    """EIs (N, h·vertical, w·horizontal, 3) of ``lenses`` (N, 2), interpolated along lines of ``steep`` lenses per view.

    ``images`` (sy, sx, h, w, 3): rendered EIs. ``covered`` (sy, sx) bool: lenses to interpolate from. ``factors``:
    views per rendered view, (horizontal, vertical).
    """
    (sy, sx, h, w, _), reach, covered = images.shape, _lens_reach(steep), covered.astype(np.float32)
    around = np.arange(-reach, reach + 1)
    rows = np.clip(lenses[:, :1] + around, 0, sy - 1)[:, :, None]
    columns = np.clip(lenses[:, 1:] + around, 0, sx - 1)[:, None, :]
    down, across = (_shear(*axis, steep) for axis in zip((h, w), factors[::-1], strict=True))
    weight = down.sum(2) @ covered[rows, columns] @ across.sum(2).T
    # (N, lens row, lens column, view row, view column, C): rows of lenses and views first, then columns.
    tall = np.einsum("aov,noqvuc->nqauc", down, images[rows, columns], optimize=True)
    detail = np.einsum("bqu,nqauc->nabc", across, tall, optimize=True)
    return np.asarray(detail / np.maximum(weight, 0.5)[..., None])


def _lens_reach(steep: float) -> int:
    return math.ceil(abs(steep)) + KERNELS[LENS_KERNEL][0]


@functools.lru_cache(maxsize=64)
def _shear(size: int, scale: int, steep: float) -> Array:
    """Weights (size·scale, lenses around, size) of the two nearest rendered views, in the lenses on the line."""
    reach, weight = _lens_reach(steep), KERNELS[LENS_KERNEL][1]
    places = (np.arange(size * scale) + 0.5) / scale - 0.5
    matrix = np.zeros((size * scale, 2 * reach + 1, size))
    for index, place in enumerate(places):
        near = kernel_matrix("linear", size, scale)[index]
        for view in np.flatnonzero(near):
            of_lenses = weight(steep * (view - place) - np.arange(-reach, reach + 1))
            matrix[index, :, view] = near[view] * of_lenses / of_lenses.sum()
    return matrix.astype(np.float32)
