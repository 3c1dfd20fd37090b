"""This computer: writing files and folders whole or not at all, reading files of limited size, cores and memory."""

import contextlib
import errno
import hashlib
import json
import math
import os
import re
import secrets
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from lfsr_core.base.messages import LfsrError

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl
    import resource

LOCK_FILE, RELEASED_FILE = "in-use", "released"  # in a staging folder; the second: others may write the target now
UNFINISHED, LOCK = ".unfinished", ".lock"  # ends of the names of a file that is being written, and of its lock
PAUSES = (0.02, 0.1, 0.3, 0.6)  # seconds between attempts to replace a file that a virus scanner may hold
LONGEST_NAME = 255  # bytes, of the usual file systems
LONGEST_PATH = {"win32": 259, "darwin": 1023}.get(sys.platform, 4095)  # longer ones need a setting of Windows
# On Windows these are devices, whatever follows a point.
DEVICES = re.compile(r"(CON|PRN|AUX|NUL|COM[0-9]|LPT[0-9])\s*(\..*)?", re.IGNORECASE)
FORBIDDEN = re.compile(r'[<>:"|?*\x00-\x1f]|[. ]$')  # in a name on Windows
IN_USE = (5, 32, 33, 1224)  # errors of Windows: refused, open in another program, locked, mapped
MOST_JSON_BYTES = 16_000_000
MOST_BRACKETS = 50  # one inside the other
WITHOUT_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS)  # file systems without locks, as in some networks
ADVICE = {errno.EPIPE: "send it to a file or a terminal", errno.EEXIST: "choose another folder",
          errno.ENAMETOOLONG: "choose a shorter name",
          **dict.fromkeys((errno.EACCES, errno.EPERM, errno.EROFS), "choose a folder you may write to"),
          **dict.fromkeys((errno.ENOSPC, errno.EFBIG, errno.EDQUOT), "free some space or choose another folder")}
CORES = "LFSR_CORES"  # environment variable: how many cores a process may use
MOST_THREADS = 8  # more threads only wait for memory
VALUES_IN_CACHE = 40_000  # of several arrays of floats at once, in the cache of a core
MOST_MEMORY = 0.9  # fraction of this computer's memory that a process may take
SECONDS_BETWEEN = 0.5  # between measurements of the memory


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yield a temporary name beside ``path`` that is renamed to it when the block ends without error.

    The block makes the file. The suffix stays, because image writers choose the format by it. A failed write leaves no
    file and becomes an LfsrError that names the cause. The next call for ``path`` removes what a killed process left.
    """
    path = Path(path)
    start = f".{path.stem[:40]}-"
    temporary = path.with_name(f"{start}{secrets.token_hex(4)}{UNFINISHED}{path.suffix}")
    with system_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        ours, entries = re.compile(rf"({re.escape(start)}[0-9a-f]{{8}}){re.escape(LOCK)}"), list(path.parent.iterdir())
        for match in filter(None, (ours.fullmatch(entry.name) for entry in entries)):
            with contextlib.suppress(OSError), path.with_name(match[0]).open("rb") as lock:
                if locks(lock):  # its process is dead
                    for entry in entries:
                        if entry.name.startswith(match[1] + UNFINISHED):
                            entry.unlink(missing_ok=True)
                    remove_locked(lock)
        # The lock is a file of its own, because Windows cannot replace an open file.
        with lock_file(temporary).open("xb") as lock:
            try:
                locks(lock)
                yield temporary
                replace(temporary, path)
            finally:
                with contextlib.suppress(OSError):  # open on Windows after an error: the next run removes both
                    temporary.unlink(missing_ok=True)
                    remove_locked(lock)


def lock_file(temporary: Path) -> Path:
    """Return the file that ``atomic_path`` locks while it writes ``temporary``."""
    return temporary.with_name(temporary.name.rpartition(UNFINISHED)[0] + LOCK)


def replace(source: str | Path, target: str | Path) -> None:
    """Rename ``source`` to ``target``, which is replaced; OSError where that fails for more than a second.

    On Windows it fails while another program, such as a virus scanner, has one of them open.
    """
    for pause in PAUSES:
        try:
            return os.replace(source, target)
        except PermissionError:
            time.sleep(pause)
    return os.replace(source, target)


def replace_files(staged: Path, folder: Path, stale: Iterable[str] = ()) -> None:
    """Move the files in ``staged`` into ``folder``, and remove the ``stale`` files there that are not replaced.

    If the process is killed meanwhile, no JSON file describes files other than those beside it. LfsrError, before
    anything is changed, where a file has the name of a folder.
    """
    paths = sorted(staged.iterdir(), key=lambda path: (path.suffix == ".json", path.name))
    for path in (folder / path.name for path in paths):
        if path.is_dir():
            raise LfsrError(f"{path} cannot be written (it is a folder): remove it or choose another folder")
    names = {path.name for path in paths if path.suffix != ".json"}
    for name in {*(path.name for path in paths), *stale} - names:
        (folder / name).unlink(missing_ok=True)
    for path in paths:
        replace(path, folder / path.name)


def locks(file: IO[bytes], otherwise: bool = False) -> bool:
    """Lock an empty file and return True, or False if another process has locked it; the lock ends with its process.

    ``otherwise``: what to return where the file system has no locks.
    """
    try:
        if sys.platform == "win32":
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return otherwise and error.errno in WITHOUT_LOCKS
    return os.fstat(file.fileno()).st_nlink > 0


def remove_locked(file: IO[bytes]) -> None:
    """Remove a file that this process has locked, and close it."""
    for _ in range(2):  # first while it is locked; on Windows, which removes no open file, after it is closed
        with contextlib.suppress(OSError):
            os.unlink(file.name)
        file.close()


@contextmanager
def staging_folder(target: Path) -> Iterator[Path]:
    """Make a hidden folder beside ``target``, or in it if it is mounted or its parent read-only; remove it at the end.

    The folder is the target's lock. Folders of dead processes are removed first, except where the file system has no
    locks. LfsrError where it cannot be made, or another process has one for ``target``.
    """
    target = target.resolve()  # "." has no name, and a link is not on the disk of its folder
    with system_errors(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        remove_dead(target)
        if target.is_dir():
            tempfile.TemporaryFile(dir=target).close()  # fails before the work, not after it
        folder = Path(tempfile.mkdtemp(prefix=f".{target.name}-lfsr-", dir=place_beside(target)))
    try:
        folder.mkdir(exist_ok=True)  # another process may have removed it while it was empty
        with (folder / LOCK_FILE).open("wb") as lock:
            if not locks(lock, otherwise=True) or any(other != folder for other in remove_dead(target)):
                raise LfsrError(f"another process is writing {target}: wait for it, or choose another folder")
            yield folder
    finally:
        remove(folder)


def remove(staging: Path) -> None:
    """Remove a staging folder, its lock file last, so that it looks in use until it is empty."""
    with contextlib.suppress(OSError):
        for path in staging.iterdir():
            if path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
            elif path.name not in (LOCK_FILE, RELEASED_FILE):
                path.unlink()
    _remove_emptied(staging)


def remove_dead(target: Path) -> list[Path]:
    """Remove the staging folders that dead processes left for ``target``, and return those that are in use."""
    target = target.resolve()
    place, used = place_beside(target), []
    swapped = str(place).swapcase()  # on Windows and macOS the same folder
    flags = re.IGNORECASE if swapped != str(place) and os.path.exists(swapped) else re.NOFLAG
    # The name ends as tempfile.mkdtemp makes it, so that no folder of the user matches.
    ours = re.compile(re.escape(f".{target.name}-lfsr-") + r"[a-z0-9_]{8}", flags)
    for folder in [path for path in place.iterdir() if ours.fullmatch(path.name)]:
        is_released = (folder / RELEASED_FILE).exists()  # looked up before the lock, which is removed first
        with contextlib.suppress(OSError):
            names = os.listdir(folder)
            if names and LOCK_FILE not in names:
                remove(folder)  # a child that outlived the owner has made the folder again
        with contextlib.suppress(OSError), (folder / LOCK_FILE).open("rb") as lock:
            if not locks(lock):
                used += [] if is_released else [folder]
                continue
            remove(folder)
        _remove_emptied(folder)  # the lock file was open on Windows, or the process was killed before it made one
    return used


def _remove_emptied(folder: Path) -> None:
    """Remove a staging folder that holds nothing but its lock; on Windows, only if no process has the lock open."""
    with contextlib.suppress(OSError):
        if {path.name for path in folder.iterdir()} <= {LOCK_FILE, RELEASED_FILE}:
            (folder / LOCK_FILE).unlink(missing_ok=True)
            (folder / RELEASED_FILE).unlink(missing_ok=True)
            folder.rmdir()


def place_beside(target: Path) -> Path:
    """Return the parent of ``target`` (no link), or ``target`` itself if it is mounted or the parent read-only."""
    name, is_apart = secrets.token_hex(8), os.path.ismount(target)  # misses a second mount of the same disk
    try:
        os.rename(target / name, target.parent / name)  # no such file: the kind of error tells whether it is mounted
    except OSError as error:
        is_apart |= error.errno == errno.EXDEV
    return target if target.is_dir() and (is_apart or not os.access(target.parent, os.W_OK)) else target.parent


@contextmanager
def system_errors(path: str | Path | None = None) -> Iterator[None]:
    """Turn errors of the system inside the block, such as a full disk, into an LfsrError.

    ``path``: the file or folder that the block writes; None to name the one in the system's error.
    """
    try:
        yield
    except MemoryError:
        raise LfsrError("there is too little memory on this machine: choose a smaller display") from None
    except OSError as error:
        name, number = path or error.filename or "the output", error.errno or 0
        advice = ADVICE.get(number, "check the folder")
        if getattr(error, "winerror", None) in IN_USE:
            advice = f"close the program that has it open, or {advice}"
        raise LfsrError(f"{name} cannot be {'written' if path or number in ADVICE else 'used'} "
                        f"({error.strerror or error}): {advice}") from None


def check_name(path: Path, room: int = 0) -> None:
    """LfsrError for a path that no file or folder can have: too long, not UTF-8, forbidden, or a link to nothing.

    ``room``: letters to leave for longer paths in it or beside it.
    """
    try:
        names = [name.encode() for name in path.parts]
    except UnicodeEncodeError:
        raise LfsrError(f"{str(path)!r} is not UTF-8 text: choose another name") from None
    if max(map(len, names), default=0) > LONGEST_NAME or len(os.fsencode(path)) + room > LONGEST_PATH:
        raise LfsrError(f"{path} is too long, expected names of at most {LONGEST_NAME} bytes and "
                        f"{LONGEST_PATH - room} in all: choose a shorter one")
    wrong = [name for name in path.parts if name != path.anchor and is_forbidden(name)]
    if sys.platform == "win32" and wrong:
        raise LfsrError(f"{path} cannot exist on Windows, which forbids the name {wrong[0]!r}: choose another name")
    for place in (path, *path.parents):
        if place.is_symlink() and not place.exists():
            raise LfsrError(f"{place} is a link to {os.readlink(place)}, which does not exist: remove it or choose "
                            "another name")


def is_forbidden(name: str) -> bool:
    """True for a name that no file or folder can have on Windows."""
    return name not in (".", "..") and bool(DEVICES.fullmatch(name) or FORBIDDEN.search(name))


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
    """Return the data of JSON text; ValueError if it is not JSON, is nested too deeply, or has a number not finite."""
    try:
        data = json.loads(content.decode("utf-8"), parse_constant=_finite, parse_float=_finite)
    except RecursionError:
        raise ValueError(f"more than {MOST_BRACKETS} brackets inside each other") from None
    except ValueError as error:
        raise ValueError(without_advice(error)) from None
    _check_depth(data, MOST_BRACKETS)
    return data


def without_advice(error: Exception) -> str:
    """Return the message of an error without Python's advice to programmers about long numbers."""
    return str(error).partition("; use sys.")[0]


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


def file_stamp(path: Path) -> str:
    """Return size and time of change of a file."""
    try:
        stat = path.stat()
    except OSError:
        return "missing"
    return f"{stat.st_size} {stat.st_mtime_ns}"


def file_digest(path: Path) -> str:
    """Return a digest of a file's bytes."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()


def cache_folder() -> Path:
    """Folder in which this user's programs store data that they can compute again."""
    if "LFSR_CACHE" in os.environ:
        return Path(os.environ["LFSR_CACHE"])
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home())) / "lfsr"
    if sys.platform == "darwin":
        return Path.home() / "Library/Caches/lfsr"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "lfsr"


def usable_cores() -> int:
    """Return the number in $LFSR_CORES, at most that of this machine's cores; without it, all of them."""
    every, asked = os.cpu_count() or 1, os.environ.get(CORES, "")
    return min(max(1, int(asked)), every) if asked.isdecimal() else every


def peak_bytes() -> int | None:
    """Most memory that this process has held so far, in bytes; None on Windows, which does not report it."""
    if sys.platform != "win32":
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return peak if sys.platform == "darwin" else peak * 1024
    return None


def watch_memory(end: Callable[[str], object]) -> None:
    """Call ``end`` with a sentence, from a thread, once this process has held MOST_MEMORY of this computer's memory.

    Windows does not report the memory, so ``end`` is never called there.
    """
    def watch() -> None:
        while sys.platform == "win32" or (peak_bytes() or 0) <= MOST_MEMORY * (
                os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")):
            time.sleep(SECONDS_BETWEEN)
        end(f"this takes more than {MOST_MEMORY:.0%} of this computer's memory: make the scene or the display "
            "smaller, or use another computer")

    threading.Thread(target=watch, daemon=True, name="lfsr-memory").start()


def in_cache(values: int) -> int:
    """Return how many items of so many ``values`` each fit into a core's cache together, at least 1."""
    return max(1, VALUES_IN_CACHE // values)


def in_threads(work: Callable[[slice], object], count: int, values: int) -> None:
    """Call ``work`` with slices of ``count`` items of so many ``values``, on every usable core, up to MOST_THREADS."""
    most = in_cache(values)
    parts = [slice(start, min(start + most, count)) for start in range(0, count, most)]
    with ThreadPoolExecutor(min(usable_cores(), MOST_THREADS)) as pool:
        list((pool.map if len(parts) > 1 else map)(work, parts))  # to start a thread takes longer than a small image
