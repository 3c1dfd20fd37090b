"""One EIA, three orders of the same pixels: reshapes only, no arithmetic.

An EIA is (H, W, C); as elemental images (sy, sx, py, px, C); as views (py, px, sy, sx, C). Lens pairs are (horizontal,
vertical) counts. View order: pixel k of an EI is view k, left to right and top to bottom.
"""

from __future__ import annotations

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError


def to_elemental_images(eia: Array, lenses: tuple[int, int]) -> Array:
    """(H, W, C) -> (sy, sx, py, px, C), a view of the same memory where possible."""
    px, py = views_per_lens(eia, lenses)
    return eia.reshape(lenses[1], py, lenses[0], px, eia.shape[2]).transpose(0, 2, 1, 3, 4)


def from_elemental_images(elemental_images: Array) -> Array:
    """(sy, sx, py, px, C) -> (H, W, C)."""
    sy, sx, py, px, channels = elemental_images.shape
    return elemental_images.transpose(0, 2, 1, 3, 4).reshape(sy * py, sx * px, channels)


def to_views(eia: Array, lenses: tuple[int, int]) -> Array:
    """(H, W, C) -> sub-aperture images (py, px, sy, sx, C)."""
    return to_elemental_images(eia, lenses).transpose(2, 3, 0, 1, 4)


def from_views(views: Array) -> Array:
    """(py, px, sy, sx, C) -> (H, W, C)."""
    return from_elemental_images(views.transpose(2, 3, 0, 1, 4))


def flip_order(eia: Array, lenses: tuple[int, int]) -> Array:
    """Reverse the pixels inside each EI in both axes: view order <-> panel order behind lenses."""
    return from_elemental_images(to_elemental_images(eia, lenses)[:, :, ::-1, ::-1])


def views_per_lens(eia: Array, lenses: tuple[int, int]) -> tuple[int, int]:
    """(px, py) of an EIA of shape (H, W, C); LfsrError unless lenses divide it."""
    if eia.ndim != 3 or eia.shape[1] % lenses[0] or eia.shape[0] % lenses[1]:
        raise LfsrError(f"image has shape {eia.shape}, expected (rows, columns, channels) with "
                        f"{lenses[1]} rows and {lenses[0]} columns of equal elemental images")
    return eia.shape[1] // lenses[0], eia.shape[0] // lenses[1]
