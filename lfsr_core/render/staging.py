"""Folders in which renders are made before they are published: locked while their maker lives, else swept."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from lfsr_core.errors import LfsrError

try:
    import fcntl
except ImportError:  # Windows: what a dead run left stays
    fcntl = None

LOCK_FILE = "in-use"


@contextlib.contextmanager
def staging_folder(target: Path) -> Iterator[Path]:
    """A hidden folder beside ``target``, removed after the block; what dead runs left for the same target goes first.

    LfsrError where the folder cannot be made, or another render into ``target`` is under way.
    """
    prefix = f".{target.name}-"
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        _in_use(target.parent, prefix)
        name = tempfile.mkdtemp(prefix=prefix, dir=target.parent)
    except OSError as error:
        raise LfsrError(f"{target} cannot be made ({error.strerror}): choose another folder") from None
    folder = Path(name)
    try:
        with (folder / LOCK_FILE).open("wb") as lock:
            if not _locks(lock) or any(found != folder for found in _in_use(target.parent, prefix)):
                raise LfsrError(f"another render into {target} is under way: wait for it, or choose another folder")
            yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _in_use(parent: Path, prefix: str) -> list[Path]:
    """Staging folders of ``prefix`` whose lock somebody holds; the others are removed."""
    held = []
    for lock_file in parent.glob(f"{prefix}*/{LOCK_FILE}") if fcntl else ():
        with contextlib.suppress(OSError), lock_file.open("rb") as lock:
            if _locks(lock):
                shutil.rmtree(lock_file.parent, ignore_errors=True)
            else:
                held.append(lock_file.parent)
    return held


def _locks(file: IO[bytes]) -> bool:
    """True if nobody else held the lock; it ends with the process that holds it, however that ends."""
    try:
        if fcntl:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return os.fstat(file.fileno()).st_nlink > 0
