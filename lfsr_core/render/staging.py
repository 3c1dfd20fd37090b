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

    LfsrError where the folder cannot be made.
    """
    prefix = f".{target.name}-"
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        _sweep(target.parent, prefix)
        name = tempfile.mkdtemp(prefix=prefix, dir=target.parent)
    except OSError as error:
        raise LfsrError(f"{target} cannot be made ({error.strerror}): choose another folder") from None
    folder = Path(name)
    try:
        with (folder / LOCK_FILE).open("wb") as lock:
            _is_ours(lock)
            yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _sweep(parent: Path, prefix: str) -> None:
    """Remove staging folders of ``prefix`` whose lock nobody holds."""
    for lock_file in parent.glob(f"{prefix}*/{LOCK_FILE}"):
        with contextlib.suppress(OSError), lock_file.open("rb") as lock:
            if _is_ours(lock):
                shutil.rmtree(lock_file.parent, ignore_errors=True)


def _is_ours(lock: IO[bytes]) -> bool:
    """True if the lock is held now; it ends with the process that holds it, however that ends."""
    if fcntl is None:
        return False
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return os.fstat(lock.fileno()).st_nlink > 0
