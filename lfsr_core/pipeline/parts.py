"""Parts of long renders, stored in a hidden folder beside the output until all of it is published.

A part is a range of an image's rows, or of its views where they are rendered one by one. The name of its file holds
the range, the image and a digest of what decides the pixels, so that parts of different renders are never mixed.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterable, Mapping
from pathlib import Path

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import read_json, replace, write_json
from lfsr_core.frames.identity import digest, first_difference
from lfsr_core.pipeline.staging import RANGE, has_parts

INPUTS_FILE = "inputs.json"


@dataclasses.dataclass(frozen=True, order=True)
class Part:
    """Rows, or views, ``first`` to before ``last`` of an image."""

    first: int
    last: int
    seconds: float = 0.0  # that it took to render

    @property
    def size(self) -> int:
        """Number of rows or views."""
        return self.last - self.first


def gaps(count: int, parts: Iterable[Part]) -> list[Part]:
    """Return the rows of an image of ``count`` rows that are in none of the ``parts``, from the top."""
    found, at = [], 0
    for part in [*sorted(parts), Part(count, count)]:
        if at < part.first:
            found.append(Part(at, part.first))
        at = max(at, part.last)
    return found


@dataclasses.dataclass(frozen=True)
class ImageParts:
    """Stored parts of one image of one render."""

    folder: Path  # made with the first part
    name: str  # of the image
    inputs: Mapping[str, str]  # what decides the pixels: a digest each, by a name for people
    another_follows: bool = False  # store the finished image too, until the next image is done

    def stored(self, count: int) -> list[tuple[Part, Path]]:
        """Return the stored parts of an image of ``count`` rows, from the top, and remove damaged ones."""
        found: list[tuple[Part, Path]] = []
        for path in sorted(self.folder.glob(f"{self._start}*.exr")):
            part = _part_of(path.stem.removeprefix(self._start))
            if part is None or part.last > count or part.first >= part.last:
                continue
            if (not found or found[-1][0].last <= part.first) and _is_complete(path):
                found.append((part, path))
        return found

    def store(self, written: Path, part: Part) -> Path:
        """Move the file ``written``, which is on the same disk, to where ``part`` is stored, and return its path."""
        write_json(self.folder / INPUTS_FILE, dict(self.inputs))
        name = f"{self._start}{part.first:06}-{part.last:06}-{round(part.seconds * 1000)}.exr"
        replace(written, self.folder / name)
        return self.folder / name

    @property
    def _start(self) -> str:
        return f"{self.name}-{digest(dict(self.inputs))}-"


def remove_others(folder: Path, inputs: Mapping[str, str]) -> str:
    """Remove the parts in ``folder`` unless they have the same ``inputs``; return a sentence if any were removed.

    ``inputs``: all of them, or those that are known already.
    """
    if not folder.is_dir():
        return ""
    try:
        known = read_json(folder / INPUTS_FILE, "the inputs of a render's parts")
    except LfsrError:
        known = None
    name = first_difference(known if isinstance(known, dict) else {}, inputs)
    if not name:
        return ""
    removed = has_parts(folder)
    for path in [*folder.glob("*.exr"), folder / INPUTS_FILE]:
        path.unlink(missing_ok=True)
    with contextlib.suppress(OSError):
        folder.rmdir()  # unless it holds the copy of the scene that is rendered
    return (f"the parts of an earlier render were made with other {name}: they are removed, and the render starts from "
            "the beginning") if removed else ""


def _part_of(text: str) -> Part | None:
    numbers = RANGE.match(text)
    return Part(int(numbers[1]), int(numbers[2]), int(numbers[3]) / 1000) if numbers else None


def _is_complete(path: Path) -> bool:
    from lfsr_core.images.exr import check_complete  # needs OpenImageIO, which Blender's panel does without

    try:
        check_complete(path)
    except LfsrError:
        path.unlink(missing_ok=True)
        return False
    return True
