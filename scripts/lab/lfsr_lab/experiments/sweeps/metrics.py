"""Metrics that only the parameter sweeps need: borders of elemental images, the moving eye, flicker, worst places.

Images are EIAs (H, W, C) of sRGB values in [0, 1] in view order.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from lfsr_core.base.arrays import Array, Mask
from lfsr_core.metrics.eia_metrics import inside_border, mean_of, split_ssim_map
from lfsr_core.optics.rays import to_elemental_images, to_views
from lfsr_lab.experiments.engine.truth import Metrics, root
from lfsr_lab.scenes.sweeps.space import Space

Pair = tuple[int, int]


@dataclasses.dataclass(frozen=True)
class Compared:
    """An EIA beside its reference."""

    x: Array  # the EIA
    a: Array  # one half of the reference
    b: Array  # the other, so that its noise cancels (docs/reference/metrics.md)
    lenses: Pair  # (sx, sy)
    mask: Mask  # (sy, sx), the foreground

    @property
    def squares(self) -> Array:
        """Squared errors as elemental images (sy, sx, py, px, C)."""
        return to_elemental_images((self.x - self.a) * (self.x - self.b), self.lenses)


def foreground_ssim(of: Compared) -> float | None:
    """Return ``ssim_eia_fg`` alone, as ``compare``; None without foreground."""
    pixels = np.divide(of.x.shape[:2], of.mask.shape).astype(int)
    inside = inside_border(np.kron(of.mask, np.ones(pixels, bool)))
    return mean_of(inside_border(split_ssim_map(of.x, of.a, of.b))[inside]) if inside.any() else None


def border_and_centre(of: Compared, width: int) -> Metrics:
    """Return RMS error and split SSIM of the outer ``width`` pixels of foreground EIs and of the rest, and their ratio.

    Values None where there are no such pixels, the ratio also where the centre's
    error is below what the reference's noise lets one see.
    """
    errors = of.squares[of.mask].mean(-1)
    local = to_elemental_images(split_ssim_map(of.x, of.a, of.b), of.lenses)[of.mask].mean(-1)
    shape = errors.shape[1:]
    down, across = (np.minimum(np.arange(size), np.arange(size)[::-1]) < width if size > 1 else np.zeros(1, bool)
                    for size in shape)
    ring = down[:, None] | across
    figures: Metrics = {}
    for name, where in (("border", ring), ("centre", ~ring)):
        some = bool(where.any()) and len(errors) > 0
        figures[f"rmse_{name}"] = root(mean_of(errors[:, where])) if some else None
        figures[f"ssim_{name}"] = mean_of(local[:, where]) if some else None
    border, centre = figures["rmse_border"], figures["rmse_centre"]
    return figures | {"border_ratio": border / centre if border is not None and centre else None}


def neighbour_view_error(of: Compared) -> float | None:
    """Return the RMS error of the differences between neighbouring views, across and down, over foreground lenses.

    What an eye sees change as it moves by one view, beside what should change;
    invented or lost detail counts, an error that all views share does not.
    """
    views = [to_views(values, of.lenses)[:, :, of.mask] for values in (of.x, of.a, of.b)]
    steps = [np.diff(values, axis=axis) for axis in (0, 1) for values in views]
    products = [(steps[i] - steps[i + 1]) * (steps[i] - steps[i + 2]) for i in (0, 3)]
    count = sum(product.size for product in products)
    return root(sum(float(product.sum(dtype=np.float64)) for product in products) / count) if count else None


def epi_straightness(image: Array, lenses: Pair, views_per_lens: int,
                     other: Array | None = None, axes: Sequence[int] = (0, 1)) -> float | None:
    """1 - (variance along the lines of the EPIs) / (variance of the image): 1 where every line is straight and even.

    Lens i, view k and lens i + 1, view k + ``views_per_lens`` see the same point through the same rays.

    Parameters
    ----------
    image: of a matt board whose points move by one lens in ``views_per_lens`` views.
    lenses: (sx, sy).
    views_per_lens: whole number.
    other: an independent render of the same, so that the noise of both cancels.
    axes: 0 for lines from row to row of lenses, 1 for those from column to column.

    Returns
    -------
    None where no two views lie so far apart.
    """
    views = to_views(image, lenses)
    twin = views if other is None else to_views(other, lenses)
    along, variance = [], mean_of((views - views.mean((0, 1, 2, 3))) * (twin - twin.mean((0, 1, 2, 3))))
    for axis in axes:
        if views.shape[axis] <= views_per_lens or views.shape[axis + 2] < 2:
            return None
        along.append(_step_along(views, axis, views_per_lens) * _step_along(twin, axis, views_per_lens))
    # Two independent values of the same variance differ by twice that.
    return 1 - sum(mean_of(part) for part in along) / len(along) / 2 / max(variance, 1e-12)


def _step_along(views: Array, axis: int, step: int) -> Array:
    """Difference of the two ends of every line that crosses one lens along one axis of (py, px, sy, sx, C)."""
    views = np.moveaxis(views, (axis, axis + 2), (0, 1))
    return views[step:, 1:] - views[:-step, :-1]


def card_pixels(space: Space, y: float, centre: tuple[float, float], half: tuple[float, float]) -> Array:
    """Return the pixels (sy, sx, py, px) bool all of whose rays meet a card at depth ``y``, by exact geometry.

    ``centre``, ``half``: its middle and half its size, (x, z) in lens pitches, z upwards.
    """
    met = []
    for axis, sign in enumerate((1, -1)):
        lens = (np.arange(space.lenses[axis]) + 0.5 - space.lenses[axis] / 2) * space.lens[axis]
        view = (np.arange(space.views[axis]) + 0.5 - space.views[axis] / 2) * space.spacing
        at = view + (lens[:, None] - view) * (space.distance + y) / space.distance
        met.append(np.abs(at - sign * centre[axis]) <= half[axis] - space.footprint(y, axis) / 2)
    return met[1][:, None, :, None] & met[0][None, :, None, :]


def flicker(frames: Sequence[Array], lenses: Pair, path: Sequence[Pair], cards: Sequence[Array]) -> float | None:
    """Return the RMS change from frame to frame of a card that moves by whole lenses, after moving it back.

    Parameters
    ----------
    frames: EIAs.
    lenses: (sx, sy).
    path: (column, row) of the card in every frame in lenses, downwards.
    cards: its pixels (sy, sx, py, px) in every frame.

    Returns
    -------
    None where no pixel shows it in two frames in a row.
    """
    total, count = 0.0, 0
    images = (to_elemental_images(frame, lenses) for frame in frames)
    before = next(images)
    for index, after in enumerate(images):
        back = np.subtract(path[index], path[index + 1])[::-1]  # in rows and columns; no card reaches round the edge
        both = cards[index] & np.roll(cards[index + 1], back, (0, 1))
        change = np.roll(after, back, (0, 1))[both] - before[both]
        total, count, before = total + float(np.sum(change**2, dtype=np.float64)), count + change.size, after
    return math.sqrt(total / count) if count else None


def worst_lens(of: Compared) -> Pair | None:
    """Return (row, column) of the foreground lens with the largest squared error; None without foreground."""
    if not of.mask.any():
        return None
    errors = np.where(of.mask, of.squares.mean((2, 3, 4)), -np.inf)
    row, column = np.unravel_index(np.argmax(errors), of.mask.shape)
    return int(row), int(column)
