"""Detail that a method took for noise, found and brought back along epipolar lines.

What was rendered minus what a method made of it should be noise, and no two pixels
share theirs. A point of the scene that was smeared away is in that residual in
every view that sees it: some views on it lies some lenses on, a line in the
epipolar-plane image whose slope is its depth (Bolles, Baker and Marimont, IJCV
1987). So the residual's covariance along such lines is lost detail, and its mean
along them is that detail with little noise. Adding it is one step of iterative
back-projection (Irani and Peleg, CVGIP 1991).
"""

from __future__ import annotations

import dataclasses
import itertools
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from threadpoolctl import threadpool_limits

from lfsr_core.arrays import Array
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct.contract import Cleaner
from lfsr_core.reconstruct.encoding import decode, encode
from lfsr_core.reconstruct.methods.interpolation import EIS_IN_CACHE
from lfsr_core.reconstruct.methods.shear import averaged, interpolated, sheared

# (lenses, views) of a step: up to three usable depths off the display plane, on both sides. On the plane denoisers lose
# little, and what looks like it is what they leave behind (docs/results/networks.md).
OFF_PLANE = ((1, 3), (1, 2), (2, 3), (1, 1), (3, 2), (2, 1), (5, 2), (3, 1))
LINES = (*OFF_PLANE, *((-lenses, views) for lenses, views in OFF_PLANE))
STEEPNESS = np.array([lenses / views for lenses, views in LINES])  # lenses per view
REACH = 2  # steps to each side of a pixel that its mean along a line takes in, in rows and in columns
AVERAGED = 2 * REACH + 1
NEIGHBOURS = 2  # lenses to each side whose covariances count together
CERTAIN = 4.0  # standard deviations by which a covariance must exceed noise
LIMIT = 1.0  # of a residual, in encoded values: a firefly is no detail
DARK = 1e-3  # scene-linear value below which √x is taken for a line
STEEPEST = 1.0  # lenses per view up to which detail is interpolated inside an EI: a point steps over lenses beyond it
KERNEL = "lanczos"  # for detail, which has no edges to ring at: see docs/results/networks.md
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
STEP, MAX_WORKERS = 24, 8
VERSION = 3  # of what comes out: figures measured with another one are out of date


@dataclasses.dataclass(frozen=True)
class LostDetail:
    """What a method lacks of a low-resolution EIA; nothing of it is known where the foreground does not show."""

    cleaned: Array  # what the method interpolates, (sy, sx, h, w, 3) encoded
    lost: Array  # what that lacks, (sy, sx, h, w, 3) encoded
    line: Array  # along which of LINES a lens lost most, (sy, sx) int
    covered: Array  # lenses where the foreground shows, (sy, sx) bool


@dataclasses.dataclass(frozen=True)
class RecoverableEIA(LowResEIA):
    """A low-resolution EIA with the ``detail`` that a method would lose."""

    detail: LostDetail | None = None


class Recovering:
    """An upscaler plus the detail that it and the denoiser before it lost; see ``contract.Upscaler``.

    Its ``prepare`` comes after the prefilters. Lenses that showed no foreground there are only upscaled.
    ``block``: side of the squares of lenses that lie beside each other by chance, as
    a plan's samples do; None where all are of one display.
    """

    def __init__(self, upscaler: Cleaner, block: int | None = None) -> None:
        self.name, self.thread_safe = upscaler.name, upscaler.thread_safe
        self._upscaler, self._block, self._share = upscaler, block, 0.0

    @property
    def notes(self) -> list[str]:
        """For the report: how many elemental images got any detail back."""
        return [*self._upscaler.notes, f"epi brought detail back in {100 * self._share:.0f} % of the foreground"]

    def prepare(self, low: LowResEIA) -> RecoverableEIA:
        """``low`` with the detail that the upscaler lacks."""
        covered = low.alpha.max((2, 3, 4)) > 0
        cleaned = self._clean_all(low, covered)
        lost, line = np.zeros_like(cleaned), np.zeros(covered.shape, int)
        rendered, share = low.rendered, np.zeros(covered.shape)
        for part in self._parts(covered):
            lost[part], share[part], line[part] = lost_detail(rendered[part], cleaned[part], covered[part],
                                                              self._upscaler.kernel, low.factors)
        self._share = float((share[covered] > 0).mean()) if covered.any() else 0.0
        return RecoverableEIA(**vars(low) | {"detail": LostDetail(cleaned, lost, line, covered)})

    def __call__(self, low: RecoverableEIA, lenses: Array) -> Array:
        """EIs of ``lenses`` (N, 2), (N, h·s, w·s, 3) float32 scene-linear."""
        lenses = np.asarray(lenses)
        result = np.empty((len(lenses), *low.finished_views, 3), np.float32)
        for start in range(0, len(lenses), EIS_IN_CACHE):
            part = slice(start, start + EIS_IN_CACHE)
            decode(self._encoded(low, lenses[part]), out=result[part])
        return result

    def _encoded(self, low: RecoverableEIA, lenses: Array) -> Array:
        (rows, columns), detail = lenses.T, low.detail
        cleaned, lost = detail.cleaned[rows, columns], detail.lost[rows, columns]
        rest = ~detail.covered[rows, columns]
        if rest.any():
            cleaned[rest] = self._upscaler.clean(low, lenses[rest])
        finished = interpolated(cleaned, self._upscaler.kernel, low.factors)
        some, steep = lost.any((1, 2, 3)), STEEPNESS[detail.line[rows, columns]]
        inside = some & (np.abs(steep) <= STEEPEST)
        if inside.any():
            finished[inside] += interpolated(lost[inside], KERNEL, low.factors)
        for slope in np.unique(steep[some & ~inside]):
            chosen = some & (steep == slope)
            finished[chosen] += sheared(detail.lost, detail.covered, lenses[chosen], low.factors, float(slope))
        return finished

    def _parts(self, covered: Array) -> list[tuple[slice, slice]]:
        """Rectangles of lenses with foreground that see nothing of each other."""
        if self._block is None:
            return [_around(covered, 0)] if covered.any() else []
        starts = (range(0, size, self._block) for size in covered.shape)
        squares = ((slice(y, y + self._block), slice(x, x + self._block)) for y, x in itertools.product(*starts))
        return [square for square in squares if covered[square].any()]

    def _clean_all(self, low: LowResEIA, covered: Array) -> Array:
        lenses, cleaned = np.argwhere(covered), np.zeros_like(low.color)

        def work(part: Array) -> None:
            cleaned[part[:, 0], part[:, 1]] = self._upscaler.clean(low, part)

        workers = max(1, min(os.cpu_count() or 1, MAX_WORKERS)) if self.thread_safe else 1
        with threadpool_limits(1, "blas"), ThreadPoolExecutor(workers) as pool:
            list(pool.map(work, [lenses[start:start + STEP] for start in range(0, len(lenses), STEP)]))
        return cleaned


def lost_detail(rendered: Array, cleaned: Array, covered: Array, kernel: str,
                factors: tuple[int, int]) -> tuple[Array, Array, Array]:
    """What interpolating ``cleaned`` will lack.

    Parameters
    ----------
    rendered : (sy, sx, h, w, 3), scene-linear
    cleaned : the same without noise, encoded
    covered : (sy, sx) bool, lenses that count
    kernel : of interpolation.KERNELS
    factors : high-resolution views per low-resolution view, (horizontal, vertical)

    Returns
    -------
    The lost detail (sy, sx, h, w, 3), encoded, and ``lost_share`` of it
    """
    shown = averaged(cleaned, kernel, factors)
    # Linear for the test, which must not take the mean of noisy roots, too low as it is, for detail.
    share, line = lost_share(residual(rendered, decode(shown)) @ LUMINANCE * covered[:, :, None, None], covered)
    lost = np.zeros_like(cleaned)
    found = np.clip(encode(rendered) - shown, -LIMIT, LIMIT) * covered[:, :, None, None, None]
    for index in np.unique(line[share > 0]):
        chosen = (line == index) & (share > 0)
        part = _around(chosen, REACH * abs(LINES[index][0]))
        mean = _mean_along(found[part], covered[part], LINES[index])
        lost[part][chosen[part]] = mean[chosen[part]]
    # Wiener's weight: detail against what the mean has left of the noise; it went along axes with several views only.
    averaged_pixels = AVERAGED ** sum(size > 1 for size in rendered.shape[2:4])
    weight = np.divide(share, share + (1 - share) / averaged_pixels, out=np.zeros_like(share), where=share > 0)
    return lost * weight.astype(np.float32)[:, :, None, None, None], share, line


def residual(rendered: Array, shown: Array) -> Array:
    """Their difference, both (…, 3) scene-linear, times the slope of ``encoding.encode``; at most LIMIT."""
    dark = np.maximum(shown, DARK)
    slope = np.float32(0.5) / np.where(dark < 1, np.sqrt(dark), dark)
    return np.clip((rendered - shown) * slope, -LIMIT, LIMIT)


def lost_share(found: Array, covered: Array) -> tuple[Array, Array]:
    """Share of a residual's variance that is detail, in [0, 1], and the index into LINES along which; (sy, sx).

    ``found`` (sy, sx, h, w): its luminance, 0 where ``covered`` (sy, sx) is False.
    """
    squares = found * found
    variance = _pooled(squares.sum((2, 3), dtype=float)) / np.maximum(_pooled(covered * float(found[0, 0].size)), 1)
    most, line = np.zeros(covered.shape), np.zeros(covered.shape, int)
    for index, step in enumerate(LINES):
        pairs = np.maximum(_pooled(_pairs(found.shape[2:], covered, step)), 1)
        products, spread = (_pooled(_products(values, step)) for values in (found, squares))
        # Their own spread, for noise has heavy tails; a pair counts at both of its ends: half as many are independent.
        detail = (products - CERTAIN * np.sqrt(2 * spread)) / pairs
        line[detail > most] = index
        most = np.maximum(most, detail)
    share = np.divide(most, variance, out=np.zeros_like(most), where=covered & (variance > 0))
    return np.clip(share, 0, 1), line


def _products(values: Array, step: tuple[int, int]) -> Array:
    """Per lens, the sum of its pixels' products with those one ``step`` on and back; (sy, sx)."""
    sums = np.zeros(values.shape[:2])
    for axis in (0, 1):
        lenses, views = _ends(values.shape, axis, step[0]), _ends(values.shape, axis + 2, step[1])
        (here, there), (across, on) = ([part[:2] for part in lenses], views)
        product = np.einsum("yxuv,yxuv->yx", values[here][across], values[there][on])
        sums[here] += product
        sums[there] += product
    return sums


def _pairs(views: tuple[int, ...], covered: Array, step: tuple[int, int]) -> Array:
    """Per lens, how many products ``_products`` adds up where both lenses are ``covered``; (sy, sx)."""
    pairs = np.zeros(covered.shape)
    for axis in (0, 1):
        here, there = (part[:2] for part in _ends((*covered.shape, *views), axis, step[0]))
        both = (covered[here] & covered[there]) * float(max(views[axis] - step[1], 0) * views[1 - axis])
        pairs[here] += both
        pairs[there] += both
    return pairs


def _mean_along(found: Array, covered: Array, step: tuple[int, int]) -> Array:
    """Mean over covered pixels up to REACH steps on and back, in rows and in columns: a patch of one point."""
    count = np.broadcast_to(covered[:, :, None, None, None], (*found.shape[:4], 1)).astype(np.float32)
    for axis in (0, 1):
        found, count = (_sum_along(values, axis, step) for values in (found, count))
    return found / np.maximum(count, 1)


def _sum_along(values: Array, axis: int, step: tuple[int, int]) -> Array:
    total = values.copy()
    for steps in range(1, REACH + 1):
        lenses = _ends(values.shape, axis, steps * step[0])
        views = _ends(values.shape, axis + 2, steps * step[1])
        (here, there), (across, on) = ([part[:2] for part in lenses], views)
        total[here][across] += values[there][on]
        total[there][on] += values[here][across]
    return total


def _ends(shape: Sequence[int], axis: int, shift: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Indices of the first four axes that pair an array with itself ``shift`` on along one of them."""
    length = shape[axis]
    shift = max(-length, min(shift, length))
    whole = [slice(None)] * 4
    first, second = list(whole), list(whole)
    first[axis] = slice(max(0, -shift), length - max(0, shift))
    second[axis] = slice(max(0, shift), length - max(0, -shift))
    return tuple(first), tuple(second)


def _pooled(values: Array) -> Array:
    """Sums over each lens and its NEIGHBOURS."""
    for axis in (0, 1):
        padded = np.pad(values, [(NEIGHBOURS, NEIGHBOURS) if axis == n else (0, 0) for n in (0, 1)])
        windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEIGHBOURS + 1, axis)
        values = windows.sum(-1)
    return values


def _around(chosen: Array, margin: int) -> tuple[slice, slice]:
    """Rectangle of the chosen lenses with ``margin`` around."""
    places = (np.flatnonzero(chosen.any(1)), np.flatnonzero(chosen.any(0)))
    return tuple(slice(max(0, where[0] - margin), where[-1] + 1 + margin) for where in places)
