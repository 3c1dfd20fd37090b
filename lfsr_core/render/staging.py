"""Folders in which renders are made before they are published: locked while their maker lives, else swept."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

from lfsr_core.errors import LfsrError
from lfsr_core.files import CAN_LOCK, locks
from lfsr_core.render.parts_folder import parts_folder

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
            if not locks(lock) or any(found != folder for found in _in_use(target.parent, prefix)):
                raise LfsrError(f"another render into {target} is under way: wait for it, or choose another folder")
            yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def remove_dead(target: Path) -> None:
    """Remove what a dead run left beside a ``target`` that it had just published."""
    _in_use(target.parent, f".{target.name}-")


def publish(staged: Path, folder: Path, stale: Iterable[str] = ()) -> None:
    """Move finished files into ``folder``; ``stale`` ones of an earlier run go, and parts that were kept for this."""
    folder.mkdir(exist_ok=True)
    for name in stale:
        (folder / name).unlink(missing_ok=True)
    for path in staged.iterdir():
        os.replace(path, folder / path.name)
    shutil.rmtree(parts_folder(folder), ignore_errors=True)


def _in_use(parent: Path, prefix: str) -> list[Path]:
    """Staging folders of ``prefix`` whose lock somebody holds; the others are removed."""
    held = []
    for lock_file in parent.glob(f"{prefix}*/{LOCK_FILE}") if CAN_LOCK else ():
        with contextlib.suppress(OSError), lock_file.open("rb") as lock:
            if locks(lock):
                shutil.rmtree(lock_file.parent, ignore_errors=True)
            else:
                held.append(lock_file.parent)
    return held
