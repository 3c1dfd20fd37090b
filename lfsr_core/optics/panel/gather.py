"""The gather map of a display: the bytes of the finished EIA that each subpixel of the panel is made from.

Per subpixel one four-byte index of its first sample, and one weight per interpolated axis.
"""

from __future__ import annotations

import dataclasses
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.cores import usable_cores
from lfsr_core.base.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.subpixel_rays import subpixel_rays

ONE = 128  # a weight of 1; its product with a difference of bytes fits into 16 bits
ROWS_AT_ONCE = 64
MAX_WORKERS = 8
CHANNELS = 3


@dataclasses.dataclass(frozen=True)
class Axis:
    """One interpolated axis of a gather map."""

    stride: int  # bytes of the EIA from a sample to the next along it
    weights: Array  # (H, W, 3) uint8 of that next sample, in 1 / ONE


@dataclasses.dataclass(frozen=True)
class GatherMap:
    """Where the subpixels of a panel (H, W, 3) find their values in the bytes of an EIA (rows, columns, 3)."""

    eia_pixels: tuple[int, int]  # (columns, rows) of the EIA
    first: Array  # (H, W, 3) int32, index of the first sample's byte
    axes: tuple[Axis, ...]  # what is interpolated; empty: the nearest sample


def gather_map(profile: DisplayProfile, sampling: str) -> GatherMap:
    """Return the gather map of a display with a lens sheet.

    ``sampling``, one of display.WEAVES: "nearest", or interpolated over "views", or over "all" (lenses too).
    LfsrError if the EIA has more bytes than a four-byte index can address.
    """
    columns, rows = profile.eia_pixels
    (sx, sy), (px, py), line = profile.lenses, profile.views, columns * CHANNELS
    # Bytes from one to the next, count, and whether interpolated: columns, rows, views across and views down.
    every = ((px * CHANNELS, sx, sampling == "all" and sx > 1), (py * line, sy, sampling == "all" and sy > 1),
             (CHANNELS, px, sampling != "nearest" and px > 1), (line, py, sampling != "nearest" and py > 1))
    if columns * rows * CHANNELS >= 2**31:
        raise LfsrError(f"the EIA has {columns}×{rows} pixels, but the weave takes fewer than 2³¹ bytes: "
                        "give the profile fewer lenses or views")
    size = (profile.panel_pixels[1], profile.panel_pixels[0], CHANNELS)
    first = np.empty(size, np.int32)
    strides = [stride for stride, _, smooth in every if smooth]
    weights = [np.empty(size, np.uint8) for _ in strides]

    def work(start: int) -> None:
        part = np.arange(start, min(start + ROWS_AT_ONCE, size[0]))
        for channel in range(CHANNELS):
            rays = subpixel_rays(profile, channel, part[:, None], np.arange(size[1]))
            places = (rays.column, rays.row, rays.view_x, rays.view_y)
            index, interpolated = np.zeros((len(part), size[1])) + channel, iter(weights)
            for place, (stride, count, smooth) in zip(places, every, strict=True):
                inside = np.clip(place, 0, count - 1)
                whole = np.minimum(np.floor(inside), count - 2) if smooth else np.floor(inside + 0.5)
                index += whole * stride
                if smooth:
                    next(interpolated)[part, :, channel] = np.rint((inside - whole) * ONE)
            first[part, :, channel] = index

    with ThreadPoolExecutor(min(usable_cores(), MAX_WORKERS)) as pool:
        list(pool.map(work, range(0, size[0], ROWS_AT_ONCE)))
    axes = (Axis(stride, weight) for stride, weight in zip(strides, weights, strict=True))
    return GatherMap((columns, rows), first, tuple(axis for axis in axes if axis.weights.any()))
