"""Temporal averaging: the mean of neighbouring frames of an animation where nothing has changed.

Two frames that show the same differ by noise, which neighbouring pixels do not have in common; a change of shape,
light or reflection extends over neighbouring pixels. So the products of the differences of neighbouring pixels, whose
mean is 0 for noise, measure the change, whatever moved. An elemental image is averaged as a whole: where one of its
pixels has changed, others may have, hidden by noise.
"""

import dataclasses
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import Notice
from lfsr_core.frames.folder import NUMBERED, first_difference, numbered
from lfsr_core.frames.frame import LOW_RES_FILE, Frame, read_frame
from lfsr_core.images.image_files import read_finite
from lfsr_core.reconstruct.upscaler import LowResEIA, encode, low_resolution

AVERAGED = ("color", "alpha", "opacity")
NEAR, WIDE = 30.0, 100.0  # weights of a change of neighbouring pixels, and of one of whole elemental images
SIGMAS = 2.5  # standard deviations by which a change must exceed noise
NEAR_SPREAD, WIDE_SPREAD = 1.25, 2**0.5  # spread of the change that white noise alone gives, × √pixels and × pixels
REACH = 1  # pixels or lenses to each side that are looked at together
CERTAIN = 0.75  # certainty of the least certain pixel above which an elemental image is averaged
TINY = 1e-12
VERSION = 3  # of the result: figures measured with another version are out of date
# Fields that two frames must have in common for their pixels to be samples of the same rays.
COMMON = ("display", "scale", "array", "matrix_world", "samples", "convention", "view_aperture", "lens_list",
          "world_visible", "world_apart")


def average_frames(low: LowResEIA, others: Iterable[LowResEIA]) -> tuple[LowResEIA, float]:
    """Average a frame with others, each elemental image by how similar they are there.

    ``others``: neighbouring frames of the animation, rendered with other seeds; only one is in memory at a time. The
    second result is how much of what the frame shows was averaged: the mean weight of the others, in [0, 1].
    """
    weights = [np.ones(low.color.shape[:2], np.float32)]
    total = {name: layer.copy() for name in AVERAGED if (layer := getattr(low, name)) is not None}
    for other in others:
        weights.append(similarity(low, other))
        for name, layer in total.items():
            theirs = getattr(other, name)
            layer += weights[-1][..., None, None, None] * (getattr(low, name) if theirs is None else theirs)
    count = np.sum(weights, 0)[..., None, None, None]
    shown = np.mean(weights[1:] or [0 * weights[0]], 0)[_shows(low)]
    averaged = dataclasses.replace(low, **{name: layer / count for name, layer in total.items()})
    return averaged, float(shown.mean()) if shown.size else 0.0


def similarity(low: LowResEIA, other: LowResEIA) -> Array:
    """Weight of another frame in [0, 1] for each lens (sy, sx): 1 where the two differ by noise alone.

    It is 0 where a pixel has probably changed, and where one frame shows something and the other nothing.
    """
    result = unchanged(encode(low.color) - encode(other.color))
    if low.opacity is not None and other.opacity is not None:
        result = np.minimum(result, unchanged(low.opacity - other.opacity))
    certainty = np.maximum(result.min((2, 3)) - CERTAIN, 0) / (1 - CERTAIN)
    return np.asarray(np.where(_shows(low) == _shows(other), certainty, 0), np.float32)


def _shows(low: LowResEIA) -> Array:
    """Lenses (sy, sx) that show anything."""
    return np.asarray(low.alpha.any((2, 3, 4)))


def unchanged(difference: Array) -> Array:
    """Certainty (sy, sx, h, w) in [0, 1] that a difference of two images (sy, sx, h, w, C) is noise alone."""
    energy = np.einsum("...c,...c->...", difference, difference)
    # What a pixel has in common with its neighbours along all four axes.
    product, pairs = np.zeros_like(energy), np.zeros_like(energy)
    for axis in range(4):
        lower, upper = _at(axis, slice(None, -1)), _at(axis, slice(1, None))
        both = np.einsum("...c,...c->...", difference[lower], difference[upper])
        for side in (lower, upper):
            product[side] += both
            pairs[side] += 1
    product /= np.maximum(pairs, 1)
    # The spread of the products themselves, as path-traced noise has heavy tails and varies from pixel to pixel.
    spread = NEAR_SPREAD * np.sqrt(_pooled(product * product) / _counts(energy.shape))
    near = _excess(_pooled(product), _pooled(energy), spread)
    # What all pixels of a few lenses have in common: the squared mean without the part of noise, which is the mean
    # product of two different pixels.
    mean, own = _pooled(difference.mean((2, 3)), 2), _pooled(energy.mean((2, 3)), 2)
    count = energy.shape[2] * energy.shape[3] * _counts(energy.shape[:2])
    change = (np.einsum("...c,...c->...", mean, mean) * count - own) / np.maximum(count - 1, 1)
    return np.asarray(1 / (1 + (NEAR * near + WIDE * _excess(change, own, WIDE_SPREAD / count * own)[..., None, None])))


def _excess(change: Array, energy: Array, spread: Array) -> Array:
    """Ratio of change to noise where the change exceeds SIGMAS times the ``spread`` that noise alone gives, else 0."""
    return np.asarray(np.maximum(change - SIGMAS * spread, 0) / np.maximum(energy - change, 0.01 * energy + TINY))


def _counts(shape: tuple[int, ...]) -> Array:
    """Number of pixels in each mean of ``_pooled``."""
    return _summed(np.ones(shape, np.float32), len(shape))


def _pooled(values: Array, axes: int = 4) -> Array:
    """Mean of each pixel and its neighbours, REACH to each side along the first ``axes``."""
    count = _counts(values.shape[:axes])
    return np.asarray(_summed(values, axes) / count.reshape(count.shape + (1,) * (values.ndim - axes)))


def _summed(values: Array, axes: int) -> Array:
    for axis in range(axes):
        total = values.copy()
        for offset in range(1, min(REACH, values.shape[axis] - 1) + 1):
            lower, upper = _at(axis, slice(None, -offset)), _at(axis, slice(offset, None))
            total[lower] += values[upper]
            total[upper] += values[lower]
        values = total
    return values


def _at(axis: int, part: slice) -> tuple[slice, ...]:
    return (*(slice(None),) * axis, part)


@dataclasses.dataclass(frozen=True)
class Neighbour:
    """A frame near another one."""

    folder: Path
    number: int
    same_rays: bool  # False where the camera array has moved, or render settings differ
    same_seed: bool  # True where both have the same noise, which a mean over both would keep


def neighbours_of(folder: Path, frame: Frame, count: int) -> list[Neighbour]:
    """Rendered frames ``near`` the one in ``folder``, from the folders beside it."""
    if not NUMBERED.match((folder := folder.resolve()).name):  # "." has no name
        return []
    wanted, around = {name: vars(frame)[name] for name in COMMON}, numbered(folder.parent)
    others = {number: around[number].frame for number in near(int(folder.name), around, count)}
    return [Neighbour(around[number].path, number, not first_difference(vars(other), wanted), other.seed == frame.seed)
            for number, other in others.items()]


def near(number: int, numbers: Collection[int], count: int) -> list[int]:
    """Return the ``count`` nearest ``numbers`` below ``number``, and above it; at an end more from the other side."""
    every = sorted({*numbers, number})
    first = max(0, min(every.index(number) - count, len(every) - 2 * count - 1))
    return [other for other in every[first:first + 2 * count + 1] if other != number]


def read_low(folder: Path) -> LowResEIA:
    """Low-resolution EIA of a frame folder, without its world; LfsrError where it cannot be read."""
    return low_resolution(read_finite(folder / LOW_RES_FILE)[0], read_frame(folder))


def averaging_notices(neighbours: Sequence[Neighbour]) -> list[Notice]:
    """Notices of neighbours that were not averaged: those with the same noise, and those that show other rays."""
    notices = (Notice("averaging-same-seed", {"frames": [each.number for each in neighbours if each.same_seed]}),
               Notice("averaging-other-rays", {"frames": [each.number for each in neighbours if not each.same_rays]}))
    return [notice for notice in notices if notice.values["frames"]]
