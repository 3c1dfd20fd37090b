"""Sheared-EPI (Wu et al., TIP 2019): an epipolar-plane image is sheared, interpolated and sheared back.

A network scores each shear of each pixel; the best shears, smoothed along the image's edges and carried to the new
views, say from which sheared interpolation a pixel is taken, and a Laplacian pyramid blends them. The smoothing is an
exact weighted median, where the authors' program quantizes. Unlike theirs, the guide of the views that are looked at
right to left is mirrored with them.
"""

from __future__ import annotations

import itertools
from functools import partial
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as nn
from scipy.ndimage import correlate1d

from lfsr_core.base.arrays import Array
from lfsr_lab.experiments.rivals.matlab import cells, convolution, median3, moved, resized, tensor, transposed

SEEN = 9  # rows that the network sees of the two of an epipolar-plane image
WINDOW, SPREAD = 5, 15.5  # of the weighted median: its radius, and its deviation in 8-bit values
BINOMIAL = np.array([1, 4, 6, 4, 1]) / 16
LEVELS = 3
STEP = 8  # pixels of which widths and heights are multiples, for the network's and the pyramid's levels
GREY = np.array([0.2989, 0.5870, 0.1140])
CORNERS = ((0, 0), (0, 1), (1, 0), (1, 1))
LOST = -255  # no shear
MOST_PIXELS = 200_000  # that the network scores at a time, unless they are of one view


class ShearedEPI:
    """The method for shears up to ``most`` pixels between the outer views; 4 in their demo, 9 in their tests."""

    def __init__(self, clones: Path, most: int = 4) -> None:
        self._layers, self._most = cells(clones, "Sheared-EPI/Model/model.mat"), most

    def __call__(self, corners: Array, ratio: int) -> Array:
        """Return views (ratio + 1, ratio + 1, H, W, 3) of (2, 2, H, W, 3), display values in [0, 1]."""
        height, width = corners.shape[2:4]
        rest = [(0, 0), (0, 0), (0, -height % STEP), (self._most, self._most + -width % STEP), (0, 0)]
        padded = np.pad(corners.astype(float), rest, mode="edge")
        found, places = [self._shears(padded, *corner) for corner in CORNERS], np.linspace(0, 1, ratio + 1)
        shears = np.stack([np.stack([_at(found, row, column) for column in places]) for row in places])
        inside = padded[:, :, :, self._most:padded.shape[3] - self._most]
        columns = np.stack([_between(inside[:, end], shears[:, end * ratio], axis=1) for end in (0, 1)], 1)
        made = np.stack([_between(columns[row], shears[row], axis=2) for row in range(ratio + 1)])
        made[:, ::ratio] = columns
        made = np.clip(made[:, :, :height, :width], 0, 1)
        made[::ratio, ::ratio] = corners
        return made

    def _shears(self, corners: Array, row: int, column: int) -> Array:
        """Return the best shear (H, W) of a corner's pixels, from it and the other view of its row."""
        mirror = -1 if column else 1
        own, other = (corners[row, index][:, ::mirror] for index in (column, 1 - column))
        inside = slice(self._most, own.shape[1] - self._most)
        shears = range(-self._most, self._most + 1)
        moved_by = np.stack([np.roll(other @ GREY, shear, 1)[:, inside] for shear in shears])
        best = np.argmax(self._scores((own @ GREY)[:, inside], moved_by), 0)
        smooth = median3(weighted_median(best, np.round(own[:, inside] * 255), len(shears)))
        return (smooth - self._most)[:, ::mirror]

    @torch.inference_mode()
    def _scores(self, first: Array, others: Array) -> Array:
        """Return how well a grey view (H, W) agrees with each of ``others`` (n, H, W), (n, H, W)."""
        if others.size > MOST_PIXELS and len(others) > 1:
            return np.concatenate([self._scores(first, other[None]) for other in others])
        x = tensor(resized(np.stack(np.broadcast_arrays(first, others), 1), 1, SEEN))
        features: list[torch.Tensor] = []
        for weight, bias in self._layers[:4]:
            x = nn.relu(convolution(x[..., ::2, ::2] if features else x, weight, bias, 1))
            features.append(x)
        for (weight, bias), skip in zip(self._layers[4:7], features[2::-1], strict=True):
            x = nn.relu(transposed(x, weight, bias, (2, 2))[..., :skip.shape[2], :skip.shape[3]])
            x = torch.cat([x, skip], 1)
        weight, bias = self._layers[7]
        return np.asarray(convolution(x, weight.reshape(3, 3, -1, 1), bias, 1)[:, 0])


def weighted_median(labels: Array, guide: Array, count: int) -> Array:
    """Return the median of labels (H, W) in windows, weighted by how alike the guide (H, W, 3) is."""
    heights, places = np.zeros((count + 1, *labels.shape)), np.indices(labels.shape)
    size = 2 * WINDOW + 1
    seen = np.pad(labels, WINDOW, constant_values=count)
    colours = np.pad(guide, [(WINDOW, WINDOW), (WINDOW, WINDOW), (0, 0)])
    for y, x in np.ndindex(size, size):
        part = slice(y, y + labels.shape[0]), slice(x, x + labels.shape[1])
        weight = np.exp(-((colours[part] - guide)**2).sum(-1) / (2 * SPREAD**2))
        heights[seen[part], *places] += weight
    return np.asarray((heights[:count].cumsum(0) * 2 >= heights[:count].sum(0)).argmax(0))


def _at(shears: list[Array], row: float, column: float) -> Array:
    """Return the shears of the view at (row, column) in [0, 1]: the mean of those of the corners, moved there."""
    total, weights = np.zeros(shears[0].shape), np.zeros(shears[0].shape)
    for (y, x), own in zip(CORNERS, shears, strict=True):
        there = np.full(own.shape, LOST)
        for shear in np.unique(own):
            steps = -shear * np.array([row - y, column - x])  # halves are rounded away from zero, as MATLAB does
            spot = np.argwhere(own == shear) + np.copysign(np.floor(np.abs(steps) + 0.5), steps).astype(int)
            spot = spot[((spot >= 0) & (spot < own.shape)).all(1)]
            there[spot[:, 0], spot[:, 1]] = shear
        weight = np.hypot(y - (1 - row), x - (1 - column)) * (there != LOST)
        total, weights = total + weight * there, weights + weight
    return total / np.where(weights == 0, 1, weights)


def _between(ends: Array, shears: Array, axis: int) -> Array:
    """Return views (n, H, W, 3) between two (2, H, W, 3), whose epipolar lines run along ``axis``.

    ``shears``: (n, H, W) of all views.
    """
    if axis == 1:  # pixels of a column move: turn it into a row
        turned = _between(ends.transpose(0, 2, 1, 3), shears.transpose(0, 2, 1), 2)
        return turned.transpose(0, 2, 1, 3)
    whole = np.moveaxis(median3(np.moveaxis(np.sign(shears) * np.floor(np.abs(shears) + 0.5), 0, -1)), -1, 0)
    blended = [np.zeros((len(shears), ends.shape[1], ends.shape[2] >> level, 3)) for level in range(LEVELS)]
    for shear in np.unique(whole):
        mask = whole == shear
        rows = mask.any((0, 2))  # a row of pixels is an image of its own
        made = _sheared(ends[:, rows], int(shear), len(shears))
        made = np.where(np.isnan(made), resized(ends[:, rows], 0, len(shears)), made)
        shares = _gaussian(mask[:, rows, :, None].astype(float))
        levels = _gaussian(made)
        details = [*(fine - _wider(coarse) for fine, coarse in itertools.pairwise(levels)), levels[-1]]
        for total, share, detail in zip(blended, shares, details, strict=True):
            total[:, rows] += share * detail
    merged = blended[-1]
    for level in blended[-2::-1]:
        merged = level + _wider(merged)
    return merged


def _sheared(ends: Array, shear: int, views: int) -> Array:
    """Return views (n, H, W, 3) interpolated where the second one is moved by ``shear`` pixels; NaN outside."""
    moves = -np.arange(views) * shear / (views - 1) + np.ceil(shear / 2)
    aligned = np.stack([moved(end, 1, move, cubic=False) for end, move in zip(ends, moves[[0, -1]], strict=True)])
    dense = resized(np.where(np.isnan(aligned), ends, aligned), 0, views)
    return np.stack([moved(view, 1, -move, cubic=True) for view, move in zip(dense, moves, strict=True)])


_smoothed = partial(correlate1d, weights=BINOMIAL, axis=2, mode="reflect")


def _wider(values: Array) -> Array:
    spread = np.zeros((*values.shape[:2], 2 * values.shape[2], values.shape[3]))
    spread[:, :, ::2] = 2 * values
    return np.asarray(_smoothed(spread))


def _gaussian(values: Array) -> list[Array]:
    """Return levels of (n, H, W, C) along rows, the finest first."""
    levels = [values]
    while len(levels) < LEVELS:
        levels.append(np.asarray(_smoothed(levels[-1]))[:, :, ::2])
    return levels

