"""Image files, closed after use: Windows neither removes nor replaces an open file."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import OpenImageIO as oiio


@contextmanager
def opened(path: str | Path) -> Iterator[oiio.ImageInput | None]:
    """Open an image file inside the block; None where OpenImageIO cannot, whose ``geterror`` then says why.

    A pipe, for which it would wait, is no file.
    """
    source = oiio.ImageInput.open(str(path)) if Path(path).is_file() else None
    try:
        yield source
    finally:
        if source is not None:
            source.close()


@functools.cache
def readable_suffixes() -> frozenset[str]:
    """Return the suffixes, without the point, of the formats that OpenImageIO reads."""
    formats = oiio.get_string_attribute("extension_list").split(";")
    return frozenset(suffix for each in formats for suffix in each.split(":")[1].split(","))


def why_unreadable(path: str | Path) -> str:
    """Return why an image file cannot be read to its end, "" if it can."""
    with opened(path) as source:
        if source is None:
            return oiio.geterror() or "no file"
        pixels = source.read_image(oiio.UNKNOWN)
        return source.geterror() or ("no pixels" if pixels is None else "")
