"""What neighbouring frames of an animation share with a frame: the mean over them, where nothing has changed.

Where frames differ by their noise alone, differences of neighbouring pixels have nothing in common; a change of shape,
light or reflection reaches over neighbours. So the products of differences of neighbours, which noise leaves at 0,
say how much has changed, whatever it was that moved.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct.encoding import encode

AVERAGED = ("color", "alpha", "opacity", "albedo", "normal")
TESTED = ("opacity", "albedo", "normal")  # besides colour
NEAR, WIDE = 30.0, 100.0  # how much a change counts that neighbours share, and one of whole elemental images
SIGMAS = 2.5  # of its own spread by which a change must stand out from noise
NEAR_SPREAD, WIDE_SPREAD = 1.25, 2**0.5  # of what white noise pretends to be change, over √pixels and pixels
REACH = 1  # pixels or lenses to each side that are looked at together
TINY = 1e-12
VERSION = 1  # of what comes out: figures measured with another one are out of date


def average_frames(low: LowResEIA, others: Iterable[LowResEIA]) -> LowResEIA:
    """The frame averaged with others, pixel by pixel as far as they show the same.

    ``others``: neighbouring frames of the same animation with random numbers of their own; one is held at a time.
    """
    count = np.ones(low.color.shape[:-1], np.float32)
    total = {name: layer.copy() for name in AVERAGED if (layer := getattr(low, name)) is not None}
    for other in others:
        weight = similarity(low, other)
        count += weight
        for name, layer in total.items():
            theirs = getattr(other, name)
            layer += weight[..., None] * (getattr(low, name) if theirs is None else theirs)
    return dataclasses.replace(low, **{name: layer / count[..., None] for name, layer in total.items()})


def similarity(low: LowResEIA, other: LowResEIA) -> Array:
    """In [0, 1] for each pixel (sy, sx, h, w): 1 where two frames differ by their noise alone."""
    result = unchanged(encode(low.color) - encode(other.color))
    for name in TESTED:
        ours, theirs = getattr(low, name), getattr(other, name)
        if ours is not None and theirs is not None:
            result = np.minimum(result, unchanged(ours - theirs))
    return result


def unchanged(difference: Array) -> Array:
    """In [0, 1] for each pixel (sy, sx, h, w) of a difference of two images (sy, sx, h, w, C): 1 where it is noise."""
    energy = np.einsum("...c,...c->...", difference, difference)
    excess = NEAR * _near(difference, energy) + WIDE * _wide(difference, energy)[..., None, None]
    return 1 / (1 + excess)


def _near(difference: Array, energy: Array) -> Array:
    """Change over noise (sy, sx, h, w), as neighbours along all four axes have it in common."""
    product, pairs = np.zeros_like(energy), np.zeros_like(energy)
    for axis in range(4):
        lower, upper = _at(axis, slice(None, -1)), _at(axis, slice(1, None))
        both = np.einsum("...c,...c->...", difference[lower], difference[upper])
        for side in (lower, upper):
            product[side] += both
            pairs[side] += 1
    product /= np.maximum(pairs, 1)
    # By the products themselves: path-traced noise has heavy tails, and differs from pixel to pixel.
    spread = NEAR_SPREAD * np.sqrt(_pooled(product * product) / _counts(energy.shape))
    return _excess(_pooled(product), _pooled(energy), spread)


def _wide(difference: Array, energy: Array) -> Array:
    """Change over noise (sy, sx), as all pixels of a few lenses have it in common."""
    mean, own = _pooled(difference.mean((2, 3)), 2), _pooled(energy.mean((2, 3)), 2)
    count = energy.shape[2] * energy.shape[3] * _counts(energy.shape[:2])
    # The squared mean less what noise adds to it: the mean product of two different pixels.
    change = (np.einsum("...c,...c->...", mean, mean) * count - own) / np.maximum(count - 1, 1)
    return _excess(change, own, WIDE_SPREAD / count * own)


def _excess(change: Array, energy: Array, spread: Array) -> Array:
    """Change over noise, where it exceeds the ``spread`` of what noise pretends to be."""
    return np.maximum(change - SIGMAS * spread, 0) / np.maximum(energy - change, 0.01 * energy + TINY)


def _counts(shape: tuple[int, ...]) -> Array:
    """How many pixels ``_pooled`` takes the mean of."""
    return _summed(np.ones(shape, np.float32), len(shape))


def _pooled(values: Array, axes: int = 4) -> Array:
    """Mean of each pixel and the neighbours that it has, REACH to each side along the first ``axes``."""
    count = _counts(values.shape[:axes])
    return _summed(values, axes) / count.reshape(count.shape + (1,) * (values.ndim - axes))


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
