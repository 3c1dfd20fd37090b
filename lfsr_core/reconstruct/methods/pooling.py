"""Pooling along depth ("pool"): missing views are made from the rendered views of every lens that sees the same point.

From one rendered view to the next, a surface point at distance z from the camera plane moves by m = (1 − D/z)·spacing /
pitch lenses (D: distance of the display plane, spacing: between rendered views; what mirrors and plane glass show is as
deep as the ray's path is long). So the ray of lens i and place A among the rendered views meets the point that view v
sees through lens i + m·(v − A). Samples near that line, of about the same slope m, are averaged, along one axis and
then along the other: sheared reconstruction, as in Lehtinen et al., Temporal Light Field Reconstruction for Rendering
Distribution Effects (2011). Unless much of the scene is steep, it is done at two places per rendered view, and views
between them are interpolated. Gaps beside a surface move with it. Where depth is unknown, views are interpolated inside
the elemental image. So is the light of a lamp in a sample that has the depth of the wall behind it: along the wall's
slope it would be a halo. What only one elemental image shows, such as a mirror's image, is added again where it exceeds
noise. docs/results/pooling.md has the figures.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from lfsr_core.base.arrays import Array, spread
from lfsr_core.base.system import in_cache, in_threads
from lfsr_core.reconstruct.upscaler import OPAQUE, LowResEIA, Upscaler, decode, encode, interpolated, kernel_matrix

REACH = 3  # rendered views to each side of a place from which samples are taken, at most
SIGMA, FALL = 1.5, -0.19  # standard deviation of the weight, in rendered views: SIGMA · samples ** FALL
COUNT = 4  # views from which samples are taken, in standard deviations of their weight
NEAR = 0.9  # lenses: samples further from the line have no weight
# Lenses by which NEAR is larger for noisy samples on the display plane, whose lines meet the same few lenses; slope
# (lenses per rendered view) from which it is not larger.
WIDER, SCATTERED = 0.65, 0.25
RIDGE = 0.02  # square lenses: samples nearer to the line on the mean tell little of how colour changes across it
NOISE = 0.2  # fraction of the power of the removed noise that may be left in a denoised image
ALIKE = 0.5  # lenses per rendered view: samples whose slopes differ by more are of two surfaces
# Lenses per rendered view from which an edge is known better from other lenses than inside its own: before a surface,
# and before nothing.
STEEP, BEFORE_NOTHING = 1.0, 0.4
STEEPEST = 8.0  # lenses per rendered view: steeper points skip too many lenses to be found again
LEAST = 0.05  # sum of weights below which nothing was found
UNKNOWN, OUTSIDE = 1e6, 1e9  # slopes of samples without depth, and of places beyond the display or its views
GLARE, CONTRAST = 2.0, 4.0  # of a sample with a lamp's light: scene-linear value, and ratio to one of the same surface
PLACES = 2  # per rendered view at which samples are pooled, of scenes that are not steep: more gain nothing there
MOST_STEEP = 0.05  # fraction of steep samples in a scene that is not steep
KERNEL, SHARP_KERNEL = "linear", "halfway"
SHARP_SAMPLES, SHARP_SCALE = 16, 3  # samples per pixel and scale from which noise allows the sharper kernel
LEAST_SAMPLES = 2  # per pixel from which detail is told from noise, and an edge from what is behind it
# Rendered views up to which an edge is looked for; lenses to each side that a sample sees of it; lenses per rendered
# view by which an edge must be nearer than what is behind it.
EDGE_REACH, HALF, APART = 3, 0.6, 0.1
VOID_REACH, LEVEL = 6, 0.15  # rendered views beside a surface that take its slope; slope up to which they are pooled
FEW = 0.3  # of what 3 × 3 lenses see
LEAST_STEEP = 0.1  # lenses per rendered view: below, no other lens is within reach
LEAST_OTHERS = 0.3  # sum of the weights of other lenses' samples
DETAIL_REACH, DETAIL_SIGMA = 3, 2.0  # rendered views: reach, and standard deviation of the weight, of residuals
NEIGHBOURS = 1  # lenses to each side over which covariances are added
LIMIT, DARK = 1.0, 1e-3  # of a residual, in encoded values; scene-linear value below which √x is taken for a line
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)


@dataclasses.dataclass(frozen=True, kw_only=True)
class PooledEIA(LowResEIA):
    """A low-resolution EIA that is pooled along its rows."""

    density: tuple[int, int]  # (horizontal, vertical) places per rendered view at which samples are pooled
    wide: Array  # (4, sx·W, padded sy, padded h), encoded colour and vertical slope; W: horizontal places of a lens
    rows: Array  # (sy,) places of the rows of lenses in it
    seen: Array  # (sy, sx) bool, lenses that see a point of known depth
    own: Array  # (sy, sx, h, w, 3) encoded colour of the rendered views
    glare: Array | None  # (sy, sx, h, w, 3) encoded colour that is interpolated instead, None where there is none


class Pooling(Upscaler):
    """Interpolation along the slopes of what is seen."""

    thread_safe = True
    follows_depth = True

    def prepare(self, low: LowResEIA) -> LowResEIA:
        """Pool along each row; ``low`` itself where no depth is known or every view is rendered."""
        if low.slope is None or low.factors == (1, 1):
            return low
        followed = _followed(low, low.slope)
        low = dataclasses.replace(low, slope=followed[..., None])
        known = np.isfinite(followed) & (np.abs(followed) < STEEPEST)
        if not known.any():
            return low
        slope = np.where(known, followed, np.float32(UNKNOWN))
        beyond = spread(slope, VOID_REACH if low.samples >= LEAST_SAMPLES else 0, (2, 3), UNKNOWN)
        if low.samples < LEAST_SAMPLES:
            slope = _with_edges(slope, low.slope_ratio)
        elif low.samples < SHARP_SAMPLES:
            slope = np.where(np.abs(beyond) < LEVEL, beyond, slope)
        # A sample of part of an edge before nothing may have any depth: it and empty ones beside move with the edge.
        whole = np.where(low.alpha[..., 0] > OPAQUE, slope, np.float32(UNKNOWN))
        beside = spread(whole, 1, (2, 3), UNKNOWN)
        slope = np.where((beside < whole) & (np.abs(beside) > BEFORE_NOTHING), beside, slope)
        is_steep = (np.abs(slope[known]) > STEEP).mean() > MOST_STEEP
        across, down = (factor if is_steep else min(factor, PLACES) for factor in low.factors)
        (sy, sx, h, w), width = known.shape, known.shape[3] * across
        steepest = float(np.abs(slope[known]).max())
        columns, length = _places(sx, steepest, low.block)
        rows, height = _places(sy, steepest * low.slope_ratio, low.block)
        source = padded((sy, h, length, w + 2 * REACH))
        glare = _glare(low.color, followed, low.block)
        color = _restored(low, np.where(glare.any(-1), np.float32(UNKNOWN), beyond), steepest) - glare
        source[:3, :, :, columns, REACH:-REACH] = color.transpose(4, 0, 2, 1, 3)
        source[3:, :, :, columns, REACH:-REACH] = slope.transpose(0, 2, 1, 3)
        wide, line = padded((sx * width, height, h + 2 * REACH)), Line.of(low, w, across)
        lenses = wide.reshape(4, sx, width, height, -1)
        starts = np.arange(sy * h) * length * (w + 2 * REACH) + REACH

        def some(part: slice) -> None:
            rays = pooled(source, (columns[part, None] * (w + 2 * REACH) + starts).ravel(), line)
            np.multiply(rays[3], np.float32(low.slope_ratio), out=rays[3], where=rays[3] < UNKNOWN)
            lenses[:, part, :, rows, REACH:-REACH] = rays.reshape(4, width, -1, sy, h).swapaxes(1, 2)

        in_threads(some, sx, width * sy * h)
        return PooledEIA(**vars(low), density=(across, down), wide=wide, rows=rows, seen=known.any((2, 3)), own=color,
                         glare=glare if glare.any() else None)

    def __call__(self, low: LowResEIA, lenses: Array) -> Array:
        """Finished EIs of ``lenses``; ``low`` is the result of ``prepare``."""
        lenses = np.asarray(lenses)
        result, kernel = np.empty((len(lenses), *low.finished_views, 3), np.float32), _kernel(low)
        some = low.seen[tuple(lenses.T)] if isinstance(low, PooledEIA) else np.zeros(len(lenses), bool)
        if not some.all():
            row, column = lenses[~some].T
            result[~some] = decode(interpolated(encode(low.color[row, column]), kernel, low.factors))
        if isinstance(low, PooledEIA):
            h, w = low.color.shape[2:4]
            width, line, chosen = w * low.density[0], Line.of(low, h, low.density[1]), np.flatnonzero(some)
            across, down = (kernel_matrix(kernel, views * places, factor / places)
                            for views, places, factor in zip((w, h), low.density, low.factors, strict=True))
            most = in_cache(width * h * low.density[1])
            for part in (chosen[start:start + most] for start in range(0, len(chosen), most)):
                row, column = lenses[part].T
                lines = (column[:, None] * width + np.arange(width)) * low.wide.shape[2] + low.rows[row][:, None]
                rays = down @ pooled(low.wide, lines.ravel() * (h + 2 * REACH) + REACH, line)[:3]
                images = (rays.reshape(-1, width) @ across.T).reshape(3, -1, len(part), len(across))
                if low.noisy is not None and low.samples >= LEAST_SAMPLES:
                    images += _left_out(low, row, column, images)
                if low.glare is not None:
                    images += interpolated(low.glare[row, column], kernel, low.factors).transpose(3, 1, 0, 2)
                images = decode(images)
                for channel, image in enumerate(images):
                    result[part, ..., channel] = image.transpose(1, 0, 2)
        return result


def _followed(low: LowResEIA, slope: Array) -> Array:
    """Slopes (sy, sx, h, w) of the first hit, or of where the ray's path ends.

    Mirrors and plane glass show the end of the path, curved glass does not. So each 3 × 3 lenses take the slope
    along which the views beside explain more of the render's variance: squared covariance over power. Where FEW
    samples go on, they are those of edges, whose path is a mean of both surfaces.
    """
    grid, first, path = slope.shape[:2], slope[..., 0], slope[..., -1]
    goes_on = (seen := np.isfinite(path)) & (first != path)
    if not len((here := np.nonzero(goes_on))[0]):
        return first
    color = encode(low.rendered) @ LUMINANCE
    mean, number = color.mean((2, 3))[here[:2]], np.ravel_multi_index(here[:2], grid)
    own, moves, sums = color[here] - mean, slope[here].T, np.zeros((2, 2, math.prod(grid)))

    for axis, step in ((0, -1), (0, 1), (1, -1), (1, 1)):
        view, block = here[axis + 2] + step, low.block or grid[axis]
        places = here[axis] + moves * step * (1.0 if axis else low.slope_ratio)
        lenses = np.floor(places).astype(int)
        inside = ((lenses // block == here[axis] // block) & ((lenses + 1) // block == here[axis] // block)).all(0)
        chosen = np.flatnonzero(inside & (view >= 0) & (view < color.shape[axis + 2]))
        index = [axis_places[chosen] for axis_places in here]
        index[axis + 2] = view[chosen]
        for sums_, place, lens in zip(sums, places[:, chosen], lenses[:, chosen], strict=True):
            index[axis] = lens
            left = color[tuple(index)]
            index[axis] = lens + 1
            there = left + (place - lens) * (color[tuple(index)] - left) - mean[chosen]
            sums_ += [np.bincount(number[chosen], there * other, math.prod(grid)) for other in (own[chosen], there)]
    (shared, power), (of_path, of_all) = (map(_pooled_lenses, part.reshape(2, *grid)) for part in sums)
    few = _pooled_lenses(goes_on.sum((2, 3)) - FEW * seen.sum((2, 3))) < 0
    better = few | (np.maximum(of_path, 0)**2 * power >= np.maximum(shared, 0)**2 * of_all)
    return np.asarray(np.where(better[..., None, None], path, first))


def _glare(color: Array, slope: Array, block: int | None) -> Array:
    """By how much samples (sy, sx, h, w, 3) outshine a neighbour of their surface, encoded; 0 of most."""
    brightest, glare = color.max(-1), np.zeros_like(color)
    here = np.nonzero(brightest > GLARE)
    for axis, step in ((0, -1), (0, 1), (1, -1), (1, 1)):
        beside, size = list(here), block or color.shape[axis]
        beside[axis] = np.clip(here[axis] + step, 0, color.shape[axis] - 1)
        there = tuple(beside)
        darker = ((np.abs(slope[there] - slope[here]) < ALIKE) & (brightest[there] * CONTRAST < brightest[here])
                  & (there[axis] // size == here[axis] // size))
        own, other = (tuple(index[darker] for index in place) for place in (here, there))
        glare[own] = np.maximum(glare[own], encode(color[own]) - encode(color[other]))
    return glare


def _restored(low: LowResEIA, slope: Array, steepest: float) -> Array:
    """Encoded colours (sy, sx, h, w, 3), with the detail that a denoiser took for noise.

    The residual, the render minus its denoised image, should be noise, which no two samples have in common. What
    samples of other lenses along the line have in common with it is lost detail, of which their mean has little
    noise; so it is added, weighted as Wiener's filter does by the covariance in NEIGHBOURS lenses around.
    """
    color, noisy = encode(low.color), low.noisy
    if noisy is None or low.samples < LEAST_SAMPLES or steepest < LEAST_STEEP:
        return color
    (sy, sx, h, w), known = slope.shape, slope < UNKNOWN
    lost = np.empty((*slope.shape, 3), np.float32)

    def residual(rows: slice) -> None:
        lost[rows] = _noise(noisy[rows], low.color[rows]) * known[rows, ..., None]

    in_threads(residual, sy, sx * h * w)
    along = lost
    for axis, ratio in ((1, 1.0), (0, low.slope_ratio)):
        # Lenses and views of one axis last, those of the other axis first.
        order = (0, 2, 1, 3) if axis else (1, 3, 0, 2)
        count, views = (sx, w) if axis else (sy, h)
        slopes = np.where(known, slope * np.float32(ratio), slope).transpose(order).reshape(-1, count, views)
        sums = _residuals(along.transpose(4, *order).reshape(-1, *slopes.shape), slopes,
                          *_places(count, steepest * ratio, low.block), own=not axis)
        along = sums.reshape(-1, *(slope.shape[each] for each in order)).transpose(*(1 + np.argsort(order)), 0)
    mean, shared, power = np.empty_like(color), np.empty((sy, sx)), np.empty((sy, sx))

    def covariance(rows: slice) -> None:
        others, count, own = along[rows, ..., :3], along[rows, ..., 3:], lost[rows]
        seen = (count > LEAST_OTHERS) & known[rows, ..., None]
        mean[rows] = (others + own) / (count + 1) * seen
        others = others / np.maximum(count, LEAST_OTHERS) * seen
        shared[rows] = np.einsum("yxvuc,yxvuc->yxc", own, others) @ LUMINANCE
        power[rows] = np.einsum("yxvuc,yxvuc->yxc", mean[rows], mean[rows]) @ LUMINANCE

    in_threads(covariance, sy, sx * h * w)
    shared, power = _pooled_lenses(shared), _pooled_lenses(power)
    weight = np.clip(np.divide(shared, power, out=np.zeros_like(power), where=power > 0), 0, 1).astype(np.float32)
    color += mean * weight[..., None, None, None]
    return color


def _places(count: int, steepest: float, block: int | None) -> tuple[Array, int]:
    """Places of ``count`` lenses in a padded row, and its length: what a line meets beyond a block is outside."""
    guard, block = math.ceil(steepest * REACH) + 2, block or count
    number = np.arange(count)
    places = number + (2 * (number // block) + 1) * guard
    return places, int(places[-1]) + guard + 1


def _noise(noisy: Array, color: Array) -> Array:
    """What a denoiser has removed, in encoded values."""
    dark = np.maximum(color, DARK)
    return np.asarray(np.clip((noisy - color) * (0.5 / np.where(dark < 1, np.sqrt(dark), dark)), -LIMIT, LIMIT))


def _left_out(low: PooledEIA, row: Array, column: Array, images: Array) -> Array:
    """What pooled ``images`` (3, h·sy, n, w·sx) lack of the rendered views of their lenses, interpolated.

    Pooling takes for noise what only one lens shows, such as a mirror's image. So the difference at the rendered views
    is added, weighted as in Wiener's filter by its power in the elemental image. At slopes at which views are too far
    apart to be interpolated, its mean over neighbouring views is added: light that has spread from an edge.
    """
    assert low.noisy is not None and low.slope is not None
    # Matrices (views, views·factor) that take from finished views what rendered ones show, in the middle of cells.
    across, down = (np.maximum(1 - np.abs(np.arange(views * factor) - (np.arange(views)[:, None] + 0.5) * factor + 0.5),
                               0).astype(np.float32)
                    for views, factor in ((low.color.shape[3 - axis], low.factors[axis]) for axis in (0, 1)))
    lacking: Array = low.own[row, column] - (down @ images.transpose(2, 0, 1, 3) @ across.T).transpose(0, 2, 3, 1)
    left, power = (np.square(part).mean((1, 2)) @ LUMINANCE for part in (
        _noise(low.noisy[row, column], low.color[row, column]), lacking))
    weight = np.clip(1 - NOISE * left / np.maximum(power, 1e-9), 0, 1)
    slope = np.nan_to_num(np.abs(low.slope[row, column]), posinf=0.0)
    lacking *= weight[:, None, None, None]
    mean = (_means(slope.shape[1]) @ lacking.transpose(0, 3, 1, 2) @ _means(slope.shape[2]).T).transpose(0, 2, 3, 1)
    lacking = mean * np.clip(2 - slope / STEEP, 0, 1) + (lacking - mean) * np.maximum(1 - slope / STEEP, 0)
    return np.asarray(interpolated(lacking.astype(np.float32), KERNEL, low.factors).transpose(3, 1, 0, 2))


def _means(views: int) -> Array:
    """Matrix (views, views) of Gaussian means over neighbouring rendered views; standard deviation: one view."""
    weights = np.exp(-0.5 * np.square(np.subtract.outer(np.arange(views), np.arange(views))))
    return np.asarray(weights / weights.sum(1, keepdims=True), np.float32)


def _with_edges(slope: Array, slope_ratio: float) -> Array:
    """Slopes (sy, sx, h, w) with which samples near the edge of a nearer surface follow that.

    A sample covers a lens: up to HALF / |m| rendered views from an edge of slope m it shows a mixture, which moves with
    the edge. Its depth is that of one of both.
    """
    for axis, ratio in ((3, 1.0), (2, slope_ratio)):
        before, slope = slope, slope.copy()
        for step in range(1, min(EDGE_REACH, slope.shape[axis] - 1) + 1):
            start, end = ((slice(None),) * axis + (part,) for part in (slice(None, -step), slice(step, None)))
            for here, there in ((start, end), (end, start)):
                edge = before[there]
                np.copyto(slope[here], edge, where=(edge < np.minimum(before[here] - APART, slope[here])) & (
                    np.abs(edge) * np.float32(ratio * step) < HALF))
    return slope


def _kernel(low: LowResEIA) -> str:
    """The sharper kernel where noise is low enough, and views far enough apart."""
    return SHARP_KERNEL if low.samples >= SHARP_SAMPLES and low.scale >= SHARP_SCALE else KERNEL


def padded(shape: tuple[int, ...], channels: int = 3) -> Array:
    """Empty samples (channels + 1, *shape), colour and slope, all of them outside."""
    samples = np.zeros((channels + 1, *shape), np.float32)
    samples[-1] = OUTSIDE
    return samples


def _pooled_lenses(values: Array) -> Array:
    """Sums over each lens and its neighbours up to NEIGHBOURS lenses away."""
    for axis in (0, 1):
        padding = [(NEIGHBOURS, NEIGHBOURS) if axis == n else (0, 0) for n in (0, 1)]
        values = sliding_window_view(np.pad(values, padding), 2 * NEIGHBOURS + 1, axis).sum(-1)
    return values


@dataclasses.dataclass(frozen=True)
class Line:
    """Where along one axis samples are pooled; the first axis of arrays is that of these places."""

    corners: tuple[Array, Array]  # (places,), the rendered views to either side
    share: Array  # (places, 1) of the second corner
    taps: tuple[tuple[Array, ...], ...]  # rendered view, its distance, and weight by it; (places, 1) each
    plain: Array  # (places, rendered views), weights of interpolation
    sharper: Array  # what the sharper kernel adds to linear interpolation
    is_noisy: bool  # too few samples to tell how colour changes across the line

    @classmethod
    def of(cls, low: LowResEIA, rendered: int, density: int) -> Self:
        """Line of an axis with ``rendered`` views of ``density`` places each; more samples need fewer views."""
        sigma = SIGMA * low.samples ** FALL
        places = ((np.arange(rendered * density) + 0.5) / density - 0.5)[:, None]
        first = np.floor(places).astype(int)
        steps = min(2 * REACH, round(COUNT * sigma)) if density > 1 else 1
        nearest = np.floor(places + 0.5 * (steps % 2)).astype(int) - (steps - 1) // 2
        views = [nearest + step for step in range(steps)]
        taps = tuple((view, (view - places).astype(np.float32),
                      np.exp(-0.5 * ((view - places) / sigma) ** 2).astype(np.float32)) for view in views)
        linear, plain = (kernel_matrix(kernel, rendered, density) for kernel in (KERNEL, _kernel(low)))
        corners = np.clip(first[:, 0], 0, rendered - 1), np.clip(first[:, 0] + 1, 0, rendered - 1)
        return cls(corners, (places - first).astype(np.float32), taps, plain, plain - linear,
                   low.samples < LEAST_SAMPLES)


def pooled(samples: Array, starts: Array, line: Line) -> Array:
    """Encoded colours and slopes (4, places, n) of n lenses, along one axis.

    ``samples`` (4, …, lenses, rendered views): see ``padded``. ``starts`` (n,): index of each lens's first view.
    """
    planes, stride = samples.reshape(4, -1), samples.shape[-1]
    own = planes.take(starts + np.arange(line.plain.shape[1])[:, None], axis=1)
    result: Array = line.plain @ own
    seen = own[3].min(0) < UNKNOWN  # lenses that see a known depth
    if not seen.all():
        result[3] = UNKNOWN
        if seen.any():
            result[:, :, seen] = pooled(samples, starts[seen], line)
        return result
    sharper = line.sharper @ own[:3] if line.sharper.any() else np.zeros((3, 1, 1), np.float32)
    before, after = own[3][line.corners[0]], own[3][line.corners[1]]
    near = np.minimum(before, after)  # UNKNOWN is farther than anything
    alike = (np.abs(before - after) < ALIKE) & (near < UNKNOWN)
    least = np.where(np.maximum(before, after) < UNKNOWN, STEEP, BEFORE_NOTHING)
    edge = ~alike & (near < UNKNOWN) & (np.abs(near) > least)
    slopes = np.where(alike, before + line.share * (after - before), near)
    followed = alike | edge
    if followed.any():
        total, sums = _sums(planes, stride, line.taps, starts, slopes, edge, is_noisy=line.is_noisy)
        sums /= np.maximum(total, LEAST)
        sums += sharper
        np.copyto(result[:3], sums, where=followed & (total > LEAST))
    place, lens = np.nonzero(~followed & (near < UNKNOWN))
    if len(place):
        # Two surfaces of small slopes meet: each corner is followed along its own, then interpolated.
        taps = [tuple(values[place, 0] for values in tap) for tap in line.taps]
        mixed = np.broadcast_to(sharper, result[:3].shape)[:, place, lens]
        for corner, share in zip(line.corners, (1 - line.share, line.share), strict=True):
            values = own[:, corner[place], lens]
            total, sums = _sums(planes, stride, taps, starts[lens], values[3], np.zeros(len(lens), bool),
                                is_noisy=line.is_noisy)
            good = (values[3] < UNKNOWN) & (total > LEAST)
            mixed += share[place, 0] * np.where(good, sums / np.maximum(total, LEAST), values[:3])
        result[:3, place, lens] = mixed
    result[3] = np.where(followed, slopes, np.where(line.share < 0.5, before, after))
    return result


def _residuals(values: Array, slopes: Array, places: Array, length: int, own: bool) -> Array:
    """Sums (4, n, lenses, views) of residuals, and of their weights, along the line of every sample, along one axis.

    ``values`` (C, n, lenses, views): residuals, and after another axis the sums of their weights. ``places``,
    ``length``: of lenses in a padded row. ``own``: whether samples of the same lens count.
    """
    (n, _, views), stride = slopes.shape, slopes.shape[-1] + 2 * REACH
    planes, result = padded((n, length, stride), len(values)), np.zeros((4, *slopes.shape), np.float32)
    planes[:-1, :, places, REACH:-REACH] = values
    planes[-1, :, places, REACH:-REACH] = slopes.transpose(1, 0, 2)
    taps = [(step, np.float32(step), np.float32(math.exp(-0.5 * (step / DETAIL_SIGMA) ** 2)))
            for step in range(-DETAIL_REACH, DETAIL_REACH + 1) if own or step]
    row, lens = np.nonzero((slopes < UNKNOWN).any(-1))  # the others have no residual
    starts = (row * length + places[lens])[:, None] * stride + REACH + np.arange(views)

    def lenses(part: slice) -> None:
        along = slopes[row[part], lens[part]]
        total, sums = _sums(planes, stride, taps, starts[part], along, np.zeros(along.shape, bool), own)
        result[:, row[part], lens[part]] = sums if len(sums) == 4 else [*sums, total]

    in_threads(lenses, len(row), views)
    return result


def _sums(planes: Array, stride: int, taps: Sequence[tuple[Any, ...]], starts: Array, slopes: Array, edge: Array,
          own: bool = True, is_noisy: bool | None = None) -> tuple[Array, Array]:
    """Sums (…) of the weights of samples along lines of ``slopes`` (…), and (C, …) of the samples times them.

    ``planes`` (C + 1, n): samples and their slopes. At an ``edge`` farther ones count too. ``own``: whether those
    of the ray's own lens do. ``is_noisy``: True for samples from more lenses, False for the value on the line of a
    plane through the samples (moving least squares) instead of their mean; None for neither.
    """
    slopes = np.where(slopes < UNKNOWN, slopes, 0)
    total, same = np.zeros_like(slopes), np.empty_like(slopes)
    sums = np.zeros((len(planes) - 1, *slopes.shape), np.float32)
    edges, fits = edge if edge.any() else None, is_noisy is False
    first, second, changes = np.zeros_like(slopes), np.zeros_like(slopes), np.zeros_like(sums)
    wider = WIDER * np.maximum(1 - np.abs(slopes) / SCATTERED, 0) if is_noisy else 0.0
    near = np.asarray((NEAR + wider)**-2, np.float32)
    for view, away, by_view in taps:
        place = slopes * away
        lens = np.floor(place + 0.5) - 1 if is_noisy else np.floor(place)
        np.subtract(place, lens, out=place)
        index = lens.astype(int)
        index *= stride
        index += starts + view
        root = np.sqrt(by_view)
        scaled = root * near
        for step in range(3 if is_noisy else 2):  # the lenses to either side of the line
            weight = place * place  # then by_view · (1 − (place / NEAR)²)²
            weight *= scaled
            np.maximum(np.subtract(root, weight, out=weight), 0, out=weight)
            weight *= weight
            if not own:
                weight *= lens != -step
            there = planes[-1].take(index)
            np.abs(np.subtract(there, slopes, out=same), out=same)
            np.maximum(np.subtract(1, np.multiply(same, np.float32(1 / ALIKE), out=same), out=same), 0, out=same)
            if edges is not None:
                np.copyto(same, (there < OUTSIDE) & (there > slopes - ALIKE), where=edges)
            weight *= same
            total += weight
            if fits:
                first += weight * place
                second += weight * place * place
            for color, change, plane in zip(sums, changes, planes, strict=False):
                values = plane.take(index)
                values *= weight
                color += values
                if fits:
                    values *= place
                    change += values
            np.subtract(place, 1, out=place)
            index += stride
    if fits:
        some = np.maximum(total, LEAST)
        changes -= first / some * sums
        sums -= changes * (first / (second + RIDGE * some))
    return total, sums
