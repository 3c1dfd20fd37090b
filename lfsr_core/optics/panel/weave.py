"""The weave: from the finished EIA, a regular light field, to the image of a panel with a lens sheet."""

import contextlib
import dataclasses
import hashlib
import json
import os
import shutil
import tempfile
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import cache_folder, in_threads, parse_json, replace
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.subpixel_rays import CHANNELS, subpixel_rays

ONE = 128  # a weight of 1; its product with a difference of bytes fits into 16 bits
VERSION = 1  # of a map's content: maps of other versions are not read
MIN_SUBPIXELS = 4_000_000  # a map of fewer is not cached, because it is computed quickly
MAX_MAPS = 3
ABOUT, FIRST = "map.json", "first.npy"
APPEARANCE = ("name", "title", "description", "background")


@dataclasses.dataclass(frozen=True)
class GatherMap:
    """Where the subpixels of a panel (H, W, 3) find their values in the bytes of an EIA (rows, columns, 3)."""

    eia_pixels: tuple[int, int]  # (columns, rows) of the EIA
    first: Array  # (H, W, 3) int32, index of the first sample's byte
    # What is interpolated, none for the nearest sample: bytes of the EIA from a sample to the next along an axis, and
    # the weights of that next sample, (H, W, 3) uint8 in 1 / ONE.
    axes: tuple[tuple[int, Array], ...]


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
    first, strides = np.empty(size, np.int32), [stride for stride, _, smooth in every if smooth]
    weights = [np.empty(size, np.uint8) for _ in strides]

    def work(rows: slice) -> None:
        part = np.arange(rows.start, rows.stop)
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

    in_threads(work, size[0], size[1])
    axes = tuple(axis for axis in zip(strides, weights, strict=True) if axis[1].any())
    return GatherMap((columns, rows), first, axes)


def cached_gather_map(profile: DisplayProfile) -> GatherMap:
    """Return the gather map of a display with a lens sheet, from the cache if possible; disk errors are ignored."""
    size = (profile.panel_pixels[1], profile.panel_pixels[0], 3)
    if np.prod(size) < MIN_SUBPIXELS:
        return gather_map(profile, profile.weave)
    data = {key: value for key, value in profile.to_dict().items() if key not in APPEARANCE} | {"version": VERSION}
    folder = cache_folder() / "weave" / hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:32]
    with contextlib.suppress(OSError, LfsrError, ValueError, KeyError):
        strides = parse_json((folder / ABOUT).read_bytes())["strides"]
        first, *weights = (np.load(folder / file, mmap_mode="r", allow_pickle=False)
                           for file in (FIRST, *(f"axis{number}.npy" for number in range(len(strides)))))
        intact = first.dtype == np.int32 and all(array.dtype == np.uint8 for array in weights)
        if intact and all(array.shape == size for array in (first, *weights)):
            os.utime(folder)
            return GatherMap(profile.eia_pixels, first, tuple(zip(strides, weights, strict=True)))
    mapped = gather_map(profile, profile.weave)
    with contextlib.suppress(OSError):
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".map-", dir=folder.parent) as staging:
            part = Path(staging, "map")
            part.mkdir()
            np.save(part / FIRST, mapped.first)
            for number, (_, axis) in enumerate(mapped.axes):
                np.save(part / f"axis{number}.npy", axis)
            (part / ABOUT).write_text(json.dumps({"strides": [stride for stride, _ in mapped.axes]}), encoding="utf-8")
            shutil.rmtree(folder, ignore_errors=True)
            replace(part, folder)
        kept = sorted((entry for entry in folder.parent.iterdir() if not entry.name.startswith(".")),
                      key=lambda entry: entry.stat().st_mtime)
        for entry in kept[:-MAX_MAPS]:
            shutil.rmtree(entry, ignore_errors=True)
    return mapped


def weave(eia: Array, mapped: GatherMap) -> Array:
    """Return the panel's image (H, W, 3) uint8 of a finished EIA (rows, columns, 3) uint8 in view order.

    ``mapped``: gather map of the display. LfsrError if the EIA is not of the size and type that the map needs.
    """
    columns, rows = mapped.eia_pixels
    if eia.shape != (rows, columns, 3) or eia.dtype != np.uint8:
        raise LfsrError(f"the EIA has shape {eia.shape} of {eia.dtype}, but the weave needs ({rows}, {columns}, 3) of "
                        "uint8: upscale the folder again")
    # Samples beyond the last byte have a weight of 0, but are read.
    source = np.zeros(eia.size + sum(stride for stride, _ in mapped.axes), np.uint8)
    source[:eia.size] = eia.reshape(-1)
    result = np.empty(mapped.first.shape, np.uint8)
    first, shown = mapped.first.reshape(-1), result.reshape(-1)
    axes = [(stride, weights.reshape(-1)) for stride, weights in mapped.axes]

    def work(part: slice) -> None:
        # ``take`` is fastest with NumPy's own index type.
        index, mixed = first[part].astype(np.intp), [(stride, weights[part]) for stride, weights in axes]
        shown[part] = _mixed(source, index, mixed)

    in_threads(work, first.size, 1)
    return result


def _mixed(source: Array, index: Array, axes: list[tuple[int, Array]]) -> Array:
    """Values at ``index``, interpolated along every axis (stride, weights), the last one outermost."""
    if not axes:
        return source.take(index)
    *inner, (stride, weights) = axes
    here = _mixed(source, index, inner)
    # The next samples lie one stride further.
    difference = _mixed(source[stride:], index, inner).astype(np.int16)
    difference -= here
    difference *= weights
    difference += ONE // 2
    difference >>= 7
    difference += here
    return difference.astype(np.uint8)
