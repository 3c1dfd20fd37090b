"""Foreground masks: the elemental images that see the foreground, from the first hits of the render."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lfsr_core.base.arrays import Array, Mask
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice
from lfsr_core.optics.eia import to_elemental_images

FOREGROUND_INDEX, BACKGROUND_INDEX = 1, 2


def foreground_mask(layers: Mapping[str, Array], lenses: tuple[int, int], dilate: int = 0) -> Mask:
    """Return a boolean (sy, sx): lenses with any hit of a foreground object.

    ``layers``: as of ``images.exr.read_layers``; ``lenses``: (sx, sy); ``dilate``: lenses by which the mask grows in
    every direction, for parts so thin that they fall between sparse views.
    """
    hit = foreground_pixels(layers)
    mask: Mask = to_elemental_images(hit[..., None], lenses).any(axis=(2, 3, 4))
    return _grown(_grown(mask, dilate).T, dilate).T if dilate else mask


def foreground_pixels(layers: Mapping[str, Array]) -> Mask:
    """Return a boolean (H, W): pixels that a foreground object covers in part.

    Where background meshes are in sight, coverage does not decide. Cycles stores the index of a pixel's first sample
    only, so a covered pixel whose first sample passed everything may be either. It counts as foreground: a lens too
    many costs time, a lens too few costs quality.
    """
    covered: Mask = layers["color"][..., 3] > 0
    index = layers.get("index")
    if index is None:
        return covered
    found: Mask = (index[..., 0] == FOREGROUND_INDEX) | (covered & (index[..., 0] != BACKGROUND_INDEX))
    return found


def unseen_notices(layers: Mapping[str, Array]) -> list[Notice]:
    """Return a notice if a render shows none of the subject: the fraction that background objects fill instead."""
    covered, index = layers["color"][..., 3] > 0, layers.get("index")
    # Without background meshes whatever covers a pixel is the subject. Pixels at the edges of such meshes are in doubt
    # everywhere, so they do not count here.
    if (covered if index is None else index == FOREGROUND_INDEX).any():
        return []
    return [Notice("subject-unseen", {"background": float(covered.mean())})]


def recall(mask: Mask, reference_mask: Mask) -> float:
    """Return the fraction of the reference's foreground lenses that are in ``mask``, 1 where it has none.

    Both are boolean (sy, sx); LfsrError where their shapes differ.
    """
    if mask.shape != reference_mask.shape:
        raise LfsrError(f"foreground masks have shapes {mask.shape} and {reference_mask.shape}: "
                        "compare frames of the same display")
    return float((mask & reference_mask).sum() / reference_mask.sum()) if reference_mask.any() else 1.0


def _grown(mask: Mask, reach: int) -> Mask:
    """Return the mask grown by ``reach`` up and down."""
    reach = min(reach, len(mask))
    padded = np.pad(mask, ((reach, reach), (0, 0)))
    grown: Mask = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis=0).any(-1)
    return grown
