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
        strides = parse_json((folder / ABOUT).read_bytes())["strides"]
        first, *weights = (np.load(folder / name, mmap_mode="r", allow_pickle=False)
                           for name in (FIRST, *(f"axis{number}.npy" for number in range(len(strides)))))
        intact = first.dtype == np.int32 and all(array.dtype == np.uint8 for array in weights)
        if intact and all(array.shape == size for array in (first, *weights)):
            os.utime(folder)
            return GatherMap(profile.eia_pixels, first, tuple(map(Axis, strides, weights)))
    mapped = gather_map(profile, profile.weave)
    with contextlib.suppress(OSError):
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
        kept = sorted((entry for entry in folder.parent.iterdir() if not entry.name.startswith(".")),
                      key=lambda entry: entry.stat().st_mtime)
        for entry in kept[:-MAX_MAPS]:
            shutil.rmtree(entry, ignore_errors=True)
    return mapped


def digest(profile: DisplayProfile) -> str:
    """Hash of everything that a map depends on, for a folder's name."""
    data = {key: value for key, value in profile.to_dict().items() if key not in APPEARANCE} | {"version": VERSION}
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:32]
