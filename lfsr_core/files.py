"""Files appear whole or not at all, and are read only up to a size."""

from __future__ import annotations

import contextlib
import errno
import json
import math
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from lfsr_core.errors import LfsrError

try:
    import fcntl
except ImportError:  # Windows: what a dead run left stays
    fcntl = None

CAN_LOCK = fcntl is not None
UNFINISHED = ".unfinished"  # in the name of what is being written
LONGEST_NAME, LONGEST_PATH = 255, 4095  # bytes, of the usual file systems
MOST_JSON_BYTES = 16_000_000
MOST_BRACKETS = 50  # one inside the other
ADVICE = {errno.EPIPE: "send it to a file or a terminal",
          **dict.fromkeys((errno.EACCES, errno.EROFS), "choose a folder you may write to"),
          **dict.fromkeys((errno.ENOSPC, errno.EFBIG, errno.EDQUOT), "free some space or choose another folder")}


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Temporary name beside ``path``, renamed to it when the block ends without error.

    The suffix is kept, because image writers choose the format by it. A failed
    write leaves neither file and becomes an LfsrError that names the cause; what a
    killed one left goes with the next.
    """
    path = Path(path)
    start = f".{path.stem[:40]}-"
    temporary = path.with_name(f"{start}{secrets.token_hex(4)}{UNFINISHED}{path.suffix}")
    with system_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        _sweep(path.parent, start, UNFINISHED + path.suffix)
        try:
            # Made here, so that its permissions are those of any new file of this user.
            file = os.fdopen(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666), "wb")
            with contextlib.closing(file):
                if CAN_LOCK:
                    locks(file)
                else:  # Windows lets nobody remove or replace an open file
                    file.close()
                yield temporary
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)


def _sweep(folder: Path, start: str, end: str) -> None:
    """Remove temporary files of dead writers: those that nobody holds."""
    left = [entry for entry in folder.iterdir() if entry.name.startswith(start) and entry.name.endswith(end)]
    for entry in left if CAN_LOCK else ():
        with contextlib.suppress(OSError), entry.open("rb") as file:
            if locks(file):
                entry.unlink(missing_ok=True)


def locks(file: IO[bytes]) -> bool:
    """True if nobody else held this file's lock; it ends with the process that holds it, however that ends.

    On Windows everything is taken for unheld.
    """
    try:
        if fcntl:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return os.fstat(file.fileno()).st_nlink > 0


@contextmanager
def system_errors(path: str | Path | None = None) -> Iterator[None]:
    """What the system refuses inside the block, as a full disk, becomes an LfsrError.

    ``path`` is what is written there, None for what the system names itself.
    """
    try:
        yield
    except MemoryError:
        raise LfsrError("there is too little memory on this machine: choose a smaller display") from None
    except OSError as error:
        name = path or error.filename or "the output"
        raise LfsrError(f"{name} cannot be {'written' if path or error.errno in ADVICE else 'used'} "
                        f"({error.strerror or error}): {ADVICE.get(error.errno, 'check the folder')}") from None


def check_name(path: Path) -> None:
    """LfsrError for a path that no file or folder can have: too long, no text, or a link to nothing."""
    try:
        names = [name.encode() for name in path.parts]
    except UnicodeEncodeError:
        raise LfsrError(f"{str(path)!r} is no UTF-8 text: choose another name") from None
    if max(map(len, names), default=0) > LONGEST_NAME or len(os.fsencode(path)) > LONGEST_PATH:
        raise LfsrError(f"{path} is too long, expected names of at most {LONGEST_NAME} bytes: choose a shorter one")
    for place in (path, *path.parents):
        if place.is_symlink() and not place.exists():
            raise LfsrError(f"{place} is a link to {os.readlink(place)}, which does not exist: remove it or choose "
                            "another name")


@contextmanager
def reading(path: str | Path, what: str) -> Iterator[IO[bytes]]:
    """A regular file, open; LfsrError names ``what`` it should have been: a pipe or a device might never end."""
    path = Path(path)
    try:
        if path.exists() and not path.is_file():
            raise LfsrError(f"{path} cannot be read as {what} (it is no regular file): check the path")
        with path.open("rb") as file:
            yield file
    except FileNotFoundError:
        raise LfsrError(f"{path} does not exist, expected {what}: check the path, or make it first") from None
    except OSError as error:
        raise LfsrError(f"{path} cannot be read as {what} ({error.strerror or error}): check the path") from None


def read_bytes(path: str | Path, what: str, most: int) -> bytes:
    """Content of a regular file of at most ``most`` bytes; LfsrError names ``what`` it should have been."""
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
    """Data of a JSON file; LfsrError names ``what`` it should have been."""
    content = read_bytes(path, what, MOST_JSON_BYTES)
    try:
        return parse_json(content)
    except ValueError as error:
        raise LfsrError(f"{path} cannot be read as {what} ({error}): render it again") from None


def parse_json(content: bytes) -> Any:
    """Data of JSON text; ValueError where it is none, nested too deeply, or has a number that is not finite."""
    try:
        data = json.loads(content.decode("utf-8"), parse_constant=_finite, parse_float=_finite)
    except RecursionError:
        raise ValueError(f"more than {MOST_BRACKETS} brackets inside each other") from None
    _check_depth(data, MOST_BRACKETS)
    return data


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text[:20]} is no finite number")
    return number


def _check_depth(data: Any, left: int) -> None:
    if not left:
        raise ValueError(f"more than {MOST_BRACKETS} brackets inside each other")
    for value in data.values() if isinstance(data, dict) else data if isinstance(data, list) else ():
        if isinstance(value, (dict, list)):
            _check_depth(value, left - 1)
