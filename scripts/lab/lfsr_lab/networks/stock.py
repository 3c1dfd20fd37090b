"""Open Image Denoise's own weights, as a start for training.

The library holds them as TZA files one after another (Apache License 2.0: keep its notice beside what is made of them).
"""

from __future__ import annotations

import contextlib
import functools
from pathlib import Path

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.reconstruct import tza
from lfsr_core.reconstruct.methods import oidn

CORE = "*OpenImageDenoise_core*"  # holds the weights
NAMES = {"hdr": (2, 3), "hdr-guided": (6, 7), "ldr": (11, 12), "ldr-guided": (15, 16)}  # place of "base" and "small"
SIZES = ("base", "small")
KNOWN = 23  # weights in libraries 2.3 to 2.5
START = tza.HEADER.pack(tza.MAGIC, tza.VERSION, tza.MINOR, 0)[:4]


def stock_weights(name: str = "hdr", size: str = "small") -> dict[str, Array]:
    """Tensors (float16) of the library's own network; ``name``: one of NAMES, ``size``: "base" or "small".

    LfsrError where no library is installed, or one of another version.
    """
    if name not in NAMES or size not in SIZES:
        raise LfsrError(f"there are no weights {name!r} of size {size!r}: choose {', '.join(NAMES)} and {SIZES}")
    path = next((core for library in oidn.find_libraries() for core in sorted(library.parent.glob(CORE))), None)
    if path is None:
        raise LfsrError("Open Image Denoise is not installed: install the package pyoidn")
    return _blobs(path)[NAMES[name][SIZES.index(size)]]


@functools.lru_cache(maxsize=1)
def _blobs(path: Path) -> tuple[dict[str, Array], ...]:
    content, found, start = path.read_bytes(), list[dict[str, Array]](), 0
    while (start := content.find(START, start)) >= 0:
        with contextlib.suppress(LfsrError):  # bytes that happen to be the same
            found.append(tza.parse(content[start:start + tza.MOST_BYTES], path))
        start += len(START)
    if len(found) != KNOWN:
        raise LfsrError(f"{path} holds {len(found)} networks, expected {KNOWN}: install pyoidn 2.5")
    return tuple(found)
