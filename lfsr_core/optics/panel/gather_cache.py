"""Cache of gather maps on disk: that of a large panel takes seconds to compute and is the same for every frame.

The cache lies in the user's cache folder, or in the folder LFSR_CACHE, and holds the maps used last.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import tempfile
from pathlib import Path

import numpy as np

from lfsr_core.base.cache import cache_folder
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import parse_json, replace
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.gather import Axis, GatherMap, gather_map

VERSION = 1  # of a map's content: maps of other versions are not read
MIN_SUBPIXELS = 4_000_000  # a map of fewer is computed faster than it is worth caching
MAX_MAPS = 3
ABOUT, FIRST = "map.json", "first.npy"
APPEARANCE = ("name", "title", "description", "background")


def cached_gather_map(profile: DisplayProfile) -> GatherMap:
    """Return the gather map of a display with a lens sheet, from the cache if possible; disk errors are ignored."""
    size = (profile.panel_pixels[1], profile.panel_pixels[0], 3)
    if np.prod(size) < MIN_SUBPIXELS:
        return gather_map(profile, profile.weave)
    folder = cache_folder() / "weave" / digest(profile)
    with contextlib.suppress(OSError, LfsrError, ValueError, KeyError):
        found = _read(folder, size, profile.eia_pixels)
        os.utime(folder)
        return found
    mapped = gather_map(profile, profile.weave)
    with contextlib.suppress(OSError):
        _write(folder, mapped)
        _remove_old(folder.parent)
    return mapped


def digest(profile: DisplayProfile) -> str:
    """Hash of everything that a map depends on, for a folder's name."""
    data = {key: value for key, value in profile.to_dict().items() if key not in APPEARANCE} | {"version": VERSION}
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:32]


def _read(folder: Path, size: tuple[int, int, int], eia_pixels: tuple[int, int]) -> GatherMap:
    strides = parse_json((folder / ABOUT).read_bytes())["strides"]
    arrays = [np.load(folder / name, mmap_mode="r", allow_pickle=False)
              for name in (FIRST, *(f"axis{number}.npy" for number in range(len(strides))))]
    kinds = [np.dtype(np.int32), *[np.dtype(np.uint8)] * len(strides)]
    if any(array.shape != size or array.dtype != kind for array, kind in zip(arrays, kinds, strict=True)):
        raise ValueError("damaged")
    axes = tuple(Axis(stride, array) for stride, array in zip(strides, arrays[1:], strict=True))
    return GatherMap(eia_pixels, arrays[0], axes)


def _write(folder: Path, mapped: GatherMap) -> None:
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".map-", dir=folder.parent) as name:
        part = Path(name, "map")
        part.mkdir()
        np.save(part / FIRST, mapped.first)
        for number, axis in enumerate(mapped.axes):
            np.save(part / f"axis{number}.npy", axis.weights)
        (part / ABOUT).write_text(json.dumps({"strides": [axis.stride for axis in mapped.axes]}), encoding="utf-8")
        shutil.rmtree(folder, ignore_errors=True)
        replace(part, folder)


def _remove_old(parent: Path) -> None:
    folders = sorted((entry for entry in parent.iterdir() if not entry.name.startswith(".")),
                     key=lambda entry: entry.stat().st_mtime)
    for entry in folders[:-MAX_MAPS]:
        shutil.rmtree(entry, ignore_errors=True)
