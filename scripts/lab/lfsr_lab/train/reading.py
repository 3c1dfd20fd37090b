"""Read the files of a training run: whatever is wrong with one becomes a sentence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import reading


@contextmanager
def open_data(path: str | Path, what: str, advice: str) -> Iterator[IO[bytes]]:
    """Open a regular file; any error inside the block becomes an LfsrError that says ``what`` was expected.

    Libraries raise what they like for damaged content, and their own advice is meant for programmers: ``advice`` stands
    in its place.
    """
    with reading(path, what) as file:
        try:
            yield file
        except Exception as error:
            reason = str(error) if isinstance(error, LfsrError) else "it is damaged, or another kind of file"
            raise LfsrError(f"{path} cannot be read as {what} ({reason}): {advice}") from error
