"""Hidden folders beside a frame folder: for what is written before it is published, and for parts of a long render."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import locks

LOCK_FILE, RELEASED_FILE = "in-use", "released"
RANGE = re.compile(r"(\d+)-(\d+)-(\d+)$")  # end of a part's name: its first row or view, the next one, milliseconds


@contextlib.contextmanager
def staging_folder(target: Path) -> Iterator[Path]:
    """Make a hidden folder beside ``target``, or in it where that cannot be, and remove it after the block.

    Folders of dead processes go first. It is the target's lock. LfsrError where it cannot be made, or another process
    has one for ``target``.
    """
    target = target.absolute()  # "." has no name
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        remove_dead(target)
        folder = Path(tempfile.mkdtemp(prefix=_prefix(target), dir=_place(target)))
    except OSError as error:
        raise LfsrError(f"{target} cannot be made ({error.strerror}): choose another folder") from None
    try:
        folder.mkdir(exist_ok=True)  # another process removes empty folders
        with (folder / LOCK_FILE).open("wb") as lock:
            if not locks(lock) or any(found != folder for found in remove_dead(target)):
                raise LfsrError(f"another process is writing {target}: wait for it, or choose another folder")
            yield folder
    finally:
        remove(folder)


def remove(staging: Path) -> None:
    """Remove a staging folder, its lock file last: a folder without one is known to be dead when it is empty."""
    with contextlib.suppress(OSError):
        for path in staging.iterdir():
            if path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
            elif path.name not in (LOCK_FILE, RELEASED_FILE):
                path.unlink()
    _remove_emptied(staging)


def release(staging: Path) -> None:
    """Let others write into the target of a staging folder, before the folder's block ends."""
    (staging / RELEASED_FILE).touch()


def has_parts(folder: Path) -> bool:
    """True if the next render may continue from a part in ``folder``."""
    return any(RANGE.search(path.stem) for path in folder.glob("*.exr"))


def remove_dead(target: Path) -> list[Path]:
    """Remove the staging folders that dead processes left for ``target``, and return those that are in use."""
    place = _place(target)
    # The end of a name that tempfile.mkdtemp gives.
    ours = re.compile(re.escape(_prefix(target)) + r"[a-z0-9_]{8}", re.IGNORECASE if _ignores_case(place) else 0)
    return [path for path in place.iterdir() if ours.fullmatch(path.name) and _is_held(path)]


def _is_held(folder: Path) -> bool:
    """True if a process works in a staging folder; the folder is removed if its process is dead."""
    with contextlib.suppress(OSError), (folder / LOCK_FILE).open("rb") as lock:
        if not locks(lock):
            return not (folder / RELEASED_FILE).exists()
        remove(folder)
    _remove_emptied(folder)  # Windows has kept the lock file, which was open; or it was killed before it had one
    return False


def _remove_emptied(folder: Path) -> None:
    """Remove a folder that is empty but for a lock; on Windows, only if no process has that open."""
    with contextlib.suppress(OSError):
        if {path.name for path in folder.iterdir()} <= {LOCK_FILE, RELEASED_FILE}:
            (folder / LOCK_FILE).unlink(missing_ok=True)
            (folder / RELEASED_FILE).unlink(missing_ok=True)
            folder.rmdir()


def _place(target: Path) -> Path:
    """Folder of the hidden folders: files cannot be moved into another file system, as a mounted ``target`` is."""
    inside = target.is_dir() and (os.path.ismount(target) or not os.access(target.parent, os.W_OK))
    return target if inside else target.parent


def _ignores_case(folder: Path) -> bool:
    """True where names that differ in the case of letters are the same, as on Windows and macOS."""
    swapped = str(folder).swapcase()
    return swapped != str(folder) and os.path.exists(swapped)


def _prefix(target: Path) -> str:
    return f".{target.name}-"
