"""Parts of a long render, in a hidden folder beside its frame folder, and how large they are to be."""

import contextlib
import dataclasses
import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import read_json, replace, write_json
from lfsr_core.frames.folder import digest, first_difference

RANGE = re.compile(r"(\d+)-(\d+)-(\d+)$")  # end of a part's name: its first row or view, the next one, milliseconds
INPUTS_FILE = "inputs.json"
SECONDS = 60.0  # that a part should take
LEAST, MOST = 0.01, 86_400.0
SECONDS_VARIABLE = "LFSR_SECONDS_PER_PART"  # environment variable that replaces SECONDS
MOST_PIXELS = 2048 * 2048  # of a part, as of a tile of Cycles
SLOW = 150_000  # path samples per second of a slow scene on two cores
TRIAL_ROWS, TRIAL_SAMPLES = 64, 2_000_000  # the trial is at most 1/64 of the rows, and so many path samples
AT_ONCE = 1.7  # × SECONDS: an image that takes no longer is rendered at once
TIMEOUT = 2.3  # × SECONDS: a render that takes longer is given up for a smaller one
GROWTH, SHRINK = 8, 16
WORTH = 0.1  # × SECONDS: a part that took less is not stored


def has_parts(folder: Path) -> bool:
    """True if the next render may continue from a part in ``folder``."""
    return any(RANGE.search(path.stem) for path in folder.glob("*.exr"))


@dataclasses.dataclass(frozen=True, order=True)
class Part:
    """Rows ``first`` to before ``last`` of an image."""

    first: int
    last: int
    seconds: float = 0.0  # that it took to render

    @property
    def size(self) -> int:
        """Number of rows."""
        return self.last - self.first


def gaps(count: int, parts: Iterable[Part]) -> list[Part]:
    """Return the rows of an image of ``count`` rows that are in none of the ``parts``, from the top."""
    missing, at = [], 0
    for part in [*sorted(parts), Part(count, count)]:
        if at < part.first:
            missing.append(Part(at, part.first))
        at = max(at, part.last)
    return missing


@dataclasses.dataclass(frozen=True)
class ImageParts:
    """Stored parts of one image of one render."""

    folder: Path  # made with the first part
    name: str  # of the image
    inputs: Mapping[str, str]  # what decides the pixels: a digest each, by a name for people
    another_follows: bool = False  # store the finished image too, until the next image is done

    def stored(self, count: int) -> list[tuple[Part, Path]]:
        """Return the stored parts of an image of ``count`` rows, from the top, and remove damaged ones."""
        from lfsr_core.images.image_files import check_complete  # needs OpenImageIO, which Blender's panel does without

        stored: list[tuple[Part, Path]] = []
        for path in sorted(self.folder.glob(f"{self._start}*.exr")):
            numbers = RANGE.match(path.stem.removeprefix(self._start))
            part = Part(int(numbers[1]), int(numbers[2]), int(numbers[3]) / 1000) if numbers else Part(0, 0)
            if (stored[-1][0].last if stored else 0) <= part.first < part.last <= count:
                try:
                    check_complete(path)
                    stored.append((part, path))
                except LfsrError:
                    path.unlink(missing_ok=True)
        return stored

    def store(self, written: Path, part: Part) -> Path:
        """Move the file ``written``, which is on the same disk, to where ``part`` is stored, and return its path."""
        write_json(self.folder / INPUTS_FILE, dict(self.inputs))
        path = self.folder / f"{self._start}{part.first:06}-{part.last:06}-{round(part.seconds * 1000)}.exr"
        replace(written, path)
        return path

    @property
    def _start(self) -> str:
        return f"{self.name}-{digest(dict(self.inputs))}-"


def remove_others(folder: Path, inputs: Mapping[str, str]) -> str:
    """Remove the parts in ``folder`` unless they have the same ``inputs``; return the name of the first that differs.

    "" if no part was removed. ``inputs``: all of them, or those that are known already.
    """
    if not folder.is_dir():
        return ""
    try:
        stored = read_json(folder / INPUTS_FILE, "the inputs of a render's parts")
    except LfsrError:
        stored = None
    if not (name := first_difference(stored if isinstance(stored, dict) else {}, inputs)):
        return ""
    removed = has_parts(folder)
    for path in [*folder.glob("*.exr"), folder / INPUTS_FILE]:
        path.unlink(missing_ok=True)
    with contextlib.suppress(OSError):
        folder.rmdir()  # unless it holds the copy of the scene that is rendered
    return name if removed else ""


def seconds_per_part() -> float:
    """Return how many seconds a part of a render should take."""
    try:
        return min(max(LEAST, float(os.environ.get(SECONDS_VARIABLE, SECONDS))), MOST)
    except ValueError:
        return SECONDS


def is_worth_storing(seconds: float) -> bool:
    """True for a part that took long enough to be stored."""
    return seconds >= WORTH * seconds_per_part()


@dataclasses.dataclass(frozen=True)
class Pace:
    """Sizes of the parts of one image."""

    width: int  # of the image, pixels
    rows: int  # of the image
    samples: int  # per pixel
    seconds: float = dataclasses.field(default_factory=seconds_per_part)  # that a part should take

    @property
    def most(self) -> int:
        """Rows that fit into memory at once."""
        return max(1, MOST_PIXELS // self.width)

    @property
    def timeout(self) -> float:
        """Seconds after which a render is given up."""
        return TIMEOUT * self.seconds

    @property
    def is_short(self) -> bool:
        """True where even a slow scene can be rendered at once."""
        return self.rows <= self.most and self.rows * self.width * self.samples <= SLOW * self.seconds

    @property
    def trial(self) -> Part:
        """A few rows in the middle, where images tend to be slowest: little work that tells the cost of the rest."""
        size = max(1, min(self.rows // TRIAL_ROWS, TRIAL_SAMPLES // (self.width * self.samples)))
        first = (self.rows - size) // 2
        return Part(first, first + size)

    def takes_one(self, trial: Part) -> bool:
        """True where the whole image can be rendered at once, going by the seconds of the ``trial``."""
        return self.rows <= self.most and trial.seconds * self.rows / trial.size <= AT_ONCE * self.seconds

    def after(self, done: Part) -> int:
        """Rows of the part after ``done``, whose seconds are those of its samples alone."""
        return max(1, min(int(done.size * self.seconds / max(done.seconds, 1e-3)), GROWTH * done.size, self.most))

    def after_timeout(self, given_up: Part) -> int:
        """Rows of the part after one that took too long."""
        return max(1, given_up.size // SHRINK)
