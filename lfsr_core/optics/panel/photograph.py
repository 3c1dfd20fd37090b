"""Rectify a photograph of a panel: from its pixels to places on the plane of the lenses.

The corners of the lit panel give a first guess, the dots of the phase pattern the exact homography. Each dot covers
several lenses, so that their steps do not move its centre.
"""

from __future__ import annotations

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError

LIT = 0.4  # of the light of the panel's middle
STEPS, GRID, WIDE = 4, 33, 2.0  # to find dots: rounds, points across a window, its half width in deviations
MIN_DOT = 0.05  # contrast of a dot, of the light range
MIN_SIDE = 200  # pixels of the lit panel


def find_homography(blue: Array, size: tuple[float, float], dots: Array, spread: float) -> Array:
    """Return the homography (3, 3) from millimetres on the plane, y up, to (column, row) in the photograph.

    ``blue`` (H, W) is the photograph's channel of the dots. On the plane, in millimetres: ``size`` of its lit part,
    ``dots`` (n, 2) where they are seen, and ``spread``, their standard deviation.
    LfsrError if no panel or too few dots are found.
    """
    corners = np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]]) / 2 * size
    matrix = fit_homography(corners, _lit_corners(blue))
    for _ in range(STEPS):
        found = [_dot_center(blue, matrix, dot, spread) for dot in dots]
        clear = np.array([center is not None for center in found])
        if clear.sum() < max(4, 0.7 * len(dots)):
            raise LfsrError(f"only {int(clear.sum())} of the pattern's {len(dots)} dots are seen in the photograph: "
                            "photograph the whole panel, sharp, showing nothing but the phase pattern")
        seen = np.array([center for center in found if center is not None])
        matrix = fit_homography(dots[clear], project(matrix, seen))
    return matrix


def project(matrix: Array, points: Array) -> Array:
    """(…, 2) points mapped by a homography."""
    x, y = points[..., 0], points[..., 1]
    scaled = [matrix[n, 0] * x + matrix[n, 1] * y + matrix[n, 2] for n in range(3)]
    return np.stack([scaled[0] / scaled[2], scaled[1] / scaled[2]], -1)


def fit_homography(points: Array, images: Array) -> Array:
    """Return the homography (3, 3) that maps (n, 2) ``points`` closest to ``images``, for 4 points or more."""
    before, after = (_normalised(places) for places in (points, images))
    x, y = project(before, points).T
    u, v = project(after, images).T
    one, none = np.ones_like(x), np.zeros_like(x)
    rows = np.concatenate([np.stack([x, y, one, none, none, none, -u * x, -u * y, -u], -1),
                           np.stack([none, none, none, x, y, one, -v * x, -v * y, -v], -1)])
    solved = np.linalg.svd(rows)[2][-1].reshape(3, 3)
    result: Array = np.linalg.inv(after) @ solved @ before
    return np.divide(result, result[2, 2])


def sample_bilinear(image: Array, places: Array) -> Array:
    """Values of an (H, W) image at (…, 2) columns and rows, bilinear; 0 outside."""
    height, width = image.shape
    column, row = places[..., 0], places[..., 1]
    left, top = np.floor(column).astype(int), np.floor(row).astype(int)
    inside = (left >= 0) & (top >= 0) & (left < width - 1) & (top < height - 1)
    left, top = np.clip(left, 0, width - 2), np.clip(top, 0, height - 2)
    across, down = column - left, row - top
    upper = image[top, left] * (1 - across) + image[top, left + 1] * across
    lower = image[top + 1, left] * (1 - across) + image[top + 1, left + 1] * across
    values: Array = (upper * (1 - down) + lower * down) * inside
    return values


def _lit_corners(blue: Array) -> Array:
    """(4, 2) columns and rows of the lit panel's corners: top left, top right, bottom right, bottom left."""
    height, width = blue.shape
    middle = np.median(blue[height * 2 // 5:height * 3 // 5, width * 2 // 5:width * 3 // 5])
    row, column = np.nonzero(blue > LIT * middle)
    if middle <= 0 or len(row) < MIN_SIDE ** 2 // 4:
        raise LfsrError("no lit panel is seen in the photograph: photograph the phase pattern in a dark room, with the "
                        "panel in the middle of the image")
    ends = [np.argmin(column + row), np.argmax(column - row), np.argmax(column + row), np.argmin(column - row)]
    corners = np.stack([column[ends], row[ends]], -1).astype(float)
    sides = np.linalg.norm(corners - np.roll(corners, 1, 0), axis=1)
    if sides.min() < MIN_SIDE / 2:
        raise LfsrError(f"the panel's shortest side is {sides.min():.0f} pixels in the photograph, but at least "
                        f"{MIN_SIDE // 2} are needed: come nearer, or use a longer lens from the same place")
    return np.asarray(corners)


def _dot_center(blue: Array, matrix: Array, dot: Array, spread: float) -> Array | None:
    """Centre on the plane, under the present ``matrix``, of the dot near ``dot``; None if no dot is there."""
    steps = np.linspace(-WIDE, WIDE, GRID) * spread
    window = np.stack(np.meshgrid(steps, steps), -1)
    values = sample_bilinear(blue, project(matrix, dot + window))
    above = np.clip(values - np.percentile(values, 20), 0, None)
    # A bell around the present centre weights the light. Its pull is undone: two equal bells meet half way.
    bell = np.exp(-0.5 * (window ** 2).sum(-1) / spread ** 2)
    total = (above * bell).sum()
    if total <= 0 or values.max() - values.min() < MIN_DOT:
        return None
    center: Array = dot + 2 * (window * (above * bell)[..., None]).sum((0, 1)) / total
    return center


def _normalised(points: Array) -> Array:
    """Homography (3, 3) that moves points to the origin and scales them to a size of about 1."""
    middle, size = points.mean(0), max(float(points.std()), 1e-12)
    return np.array([[1 / size, 0, -middle[0] / size], [0, 1 / size, -middle[1] / size], [0, 0, 1.0]])
