"""Files appear whole or not at all."""

from __future__ import annotations

import errno
import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lfsr_core.errors import LfsrError


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Temporary name beside ``path``, renamed to it when the block ends without error.

    The suffix is kept, because image writers choose the format by it. A failed
    write leaves neither file and becomes an LfsrError that names the cause.
    """
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
        os.close(handle)
    except OSError as error:
        raise _cannot_write(path, error) from None
    temporary = Path(name)
    try:
        yield temporary
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except OSError as error:
        raise _cannot_write(path, error) from None
    finally:
        temporary.unlink(missing_ok=True)


def _cannot_write(path: Path, error: OSError) -> LfsrError:
    advice = {errno.ENOSPC: "free some space or choose another folder",
              errno.EACCES: "choose a folder you may write to",
              errno.EROFS: "choose a folder you may write to"}.get(error.errno, "check the folder")
    return LfsrError(f"{path} cannot be written ({error.strerror or error}): {advice}")


def write_json(path: str | Path, data: Any) -> None:
    """Write ``data`` as indented JSON, whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(data, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def read_json(path: str | Path, what: str) -> Any:
    """Data of a JSON file; LfsrError names ``what`` it should have been."""
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise LfsrError(f"{path} does not exist, expected {what}: check the folder or render it first") from None
    except (OSError, json.JSONDecodeError, UnicodeDecodeError) as error:
        raise LfsrError(f"{path} cannot be read as {what} ({error}): render it again") from None
