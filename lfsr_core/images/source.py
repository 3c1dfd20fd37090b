"""Image files, closed after use: Windows neither removes nor replaces an open file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import OpenImageIO as oiio


@contextmanager
def opened(path: str | Path) -> Iterator[oiio.ImageInput | None]:
    """Open an image file inside the block; None where OpenImageIO cannot, whose ``geterror`` then says why."""
    source = oiio.ImageInput.open(str(path))
    try:
        yield source
    finally:
        if source is not None:
            source.close()
