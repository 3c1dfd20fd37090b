"""Write files whole or not at all, and read them up to a size."""

from __future__ import annotations

import contextlib
import errno
import json
import math
import os
import secrets
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from lfsr_core.errors import LfsrError

if sys.platform != "win32":
    import fcntl

CAN_LOCK = sys.platform != "win32"  # elsewhere, files of dead processes stay
UNFINISHED = ".unfinished"  # in the name of a file that is being written
LONGEST_NAME, LONGEST_PATH = 255, 4095  # bytes, of the usual file systems
MOST_JSON_BYTES = 16_000_000
MOST_BRACKETS = 50  # one inside the other
ADVICE = {errno.EPIPE: "send it to a file or a terminal",
          **dict.fromkeys((errno.EACCES, errno.EROFS), "choose a folder you may write to"),
          **dict.fromkeys((errno.ENOSPC, errno.EFBIG, errno.EDQUOT), "free some space or choose another folder")}


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yield a temporary name beside ``path`` that is renamed to it when the block ends without error.

    The suffix stays, because image writers choose the format by it. A failed write leaves no file and becomes an
    LfsrError that names the cause. What a killed process left is removed by the next.
    """
    path = Path(path)
    start = f".{path.stem[:40]}-"
    temporary = path.with_name(f"{start}{secrets.token_hex(4)}{UNFINISHED}{path.suffix}")
    with system_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        _remove_dead(path.parent, start, UNFINISHED + path.suffix)
        try:
            # Made here, so that it has the permissions of any new file of this user.
            file = os.fdopen(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666), "wb")
            with contextlib.closing(file):
                if CAN_LOCK:
                    locks(file)
                else:  # Windows does not remove or replace an open file
                    file.close()
                yield temporary
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)


def locks(file: IO[bytes]) -> bool:
    """Lock a file and return True, or False if another process holds its lock; the lock ends with its process.

    On Windows nothing is locked.
    """
    try:
        if sys.platform != "win32":
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return os.fstat(file.fileno()).st_nlink > 0


@contextmanager
def system_errors(path: str | Path | None = None) -> Iterator[None]:
    """Turn errors of the system inside the block, such as a full disk, into an LfsrError.

    ``path``: the file or folder that is written there, None to name what the system names.
    """
    try:
        yield
    except MemoryError:
        raise LfsrError("there is too little memory on this machine: choose a smaller display") from None
    except OSError as error:
        name, number = path or error.filename or "the output", error.errno or 0
        raise LfsrError(f"{name} cannot be {'written' if path or number in ADVICE else 'used'} "
                        f"({error.strerror or error}): {ADVICE.get(number, 'check the folder')}") from None


def check_name(path: Path) -> None:
    """LfsrError for a path that no file or folder can have: too long, not UTF-8, or a link to nothing."""
    try:
        names = [name.encode() for name in path.parts]
    except UnicodeEncodeError:
        raise LfsrError(f"{str(path)!r} is not UTF-8 text: choose another name") from None
    if max(map(len, names), default=0) > LONGEST_NAME or len(os.fsencode(path)) > LONGEST_PATH:
        raise LfsrError(f"{path} is too long, expected names of at most {LONGEST_NAME} bytes: choose a shorter one")
    for place in (path, *path.parents):
        if place.is_symlink() and not place.exists():
            raise LfsrError(f"{place} is a link to {os.readlink(place)}, which does not exist: remove it or choose "
                            "another name")


@contextmanager
def reading(path: str | Path, what: str) -> Iterator[IO[bytes]]:
    """Open a regular file; LfsrError says ``what`` was expected there. A pipe or a device might never end."""
    path = Path(path)
    try:
        if path.exists() and not path.is_file():
            raise LfsrError(f"{path} cannot be read as {what} (it is not a regular file): check the path")
        with path.open("rb") as file:
            yield file
    except FileNotFoundError:
        raise LfsrError(f"{path} does not exist, expected {what}: check the path, or make it first") from None
    except OSError as error:
        raise LfsrError(f"{path} cannot be read as {what} ({error.strerror or error}): check the path") from None


def read_bytes(path: str | Path, what: str, most: int) -> bytes:
    """Return the content of a regular file of at most ``most`` bytes; LfsrError says ``what`` was expected."""
    with reading(path, what) as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise LfsrError(f"{path} cannot be read as {what} (it has more than {most} bytes): check the path")
    return content


def write_json(path: str | Path, data: Any) -> None:
    """Write ``data`` as indented JSON, whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(data, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def read_json(path: str | Path, what: str) -> Any:
    """Return the data of a JSON file; LfsrError says ``what`` was expected."""
    content = read_bytes(path, what, MOST_JSON_BYTES)
    try:
        return parse_json(content)
    except ValueError as error:
        raise LfsrError(f"{path} cannot be read as {what} ({error}): render it again") from None


def parse_json(content: bytes) -> Any:
    """Return the data of JSON text; ValueError if it is none, nested too deeply, or has a number that is not finite."""
    try:
        data = json.loads(content.decode("utf-8"), parse_constant=_finite, parse_float=_finite)
    except RecursionError:
        raise ValueError(f"more than {MOST_BRACKETS} brackets inside each other") from None
    _check_depth(data, MOST_BRACKETS)
    return data


def _remove_dead(folder: Path, start: str, end: str) -> None:
    """Remove the temporary files of dead processes, which nobody has locked."""
    left = [entry for entry in folder.iterdir() if entry.name.startswith(start) and entry.name.endswith(end)]
    for entry in left if CAN_LOCK else ():
        with contextlib.suppress(OSError), entry.open("rb") as file:
            if locks(file):
                entry.unlink(missing_ok=True)


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text[:20]} is not a finite number")
    return number


def _check_depth(data: Any, left: int) -> None:
    if not left:
        raise ValueError(f"more than {MOST_BRACKETS} brackets inside each other")
    for value in data.values() if isinstance(data, dict) else data if isinstance(data, list) else ():
        if isinstance(value, (dict, list)):
            _check_depth(value, left - 1)
