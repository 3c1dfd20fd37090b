"""Which elemental images see the foreground, by the first hits of the render itself."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.optics.eia import to_elemental_images

MOST_DILATE = 65536
FOREGROUND_INDEX, BACKGROUND_INDEX = 1, 2


def foreground_mask(layers: Mapping[str, Array], lenses: tuple[int, int], dilate: int = 0) -> Array:
    """Boolean (sy, sx): lenses with any hit of a foreground object.

    ``layers`` as ``images.exr.read_layers`` gives them, ``lenses`` (sx, sy).
    ``dilate`` grows the mask by so many lenses in every direction, for parts so
    thin that they fall between sparse views. LfsrError for a negative ``dilate``.
    """
    check_dilate(dilate)
    hit = foreground_pixels(layers)
    mask = to_elemental_images(hit[..., None], lenses).any(axis=(2, 3, 4))
    if dilate:
        mask = _grown(_grown(mask, dilate).T, dilate).T
    return mask


def check_dilate(dilate: int) -> None:
    """LfsrError unless a mask can be grown by that many lenses."""
    if not 0 <= dilate <= MOST_DILATE:
        raise LfsrError(f"dilation of the foreground mask is {str(dilate)[:20]}, but it must be 0 to {MOST_DILATE} "
                        "lenses")


def _grown(mask: Array, reach: int) -> Array:
    """The mask grown by ``reach`` up and down."""
    reach = min(reach, len(mask))
    padded = np.pad(mask, ((reach, reach), (0, 0)))
    return np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis=0).any(-1)


def foreground_pixels(layers: Mapping[str, Array]) -> Array:
    """Boolean (H, W): pixels that a foreground object covers in part.

    Where background meshes are in sight, coverage alone does not decide it. Cycles
    stores the index of a pixel's first sample only, so a covered pixel whose
    first sample passed everything may be either: it counts as foreground, since
    a lens too many costs time and a lens too few costs the picture.
    """
    covered = layers["color"][..., 3] > 0
    index = layers.get("index")
    if index is None:
        return covered
    return (index[..., 0] == FOREGROUND_INDEX) | (covered & (index[..., 0] != BACKGROUND_INDEX))


def recall(mask: Array, reference_mask: Array) -> float:
    """Share of the reference's foreground lenses that ``mask`` has too; 1 where it has none. Both (sy, sx) bool."""
    if mask.shape != reference_mask.shape:
        raise LfsrError(f"foreground masks have shapes {mask.shape} and {reference_mask.shape}: "
                        "compare frames of the same display")
    return float((mask & reference_mask).sum() / reference_mask.sum()) if reference_mask.any() else 1.0
