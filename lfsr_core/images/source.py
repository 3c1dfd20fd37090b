"""Image files, closed after use: Windows neither removes nor replaces an open file."""

from __future__ import annotations

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
