"""What a virtual screen shows, picture by picture, read from the file in which Xvfb keeps its pixels.

A look costs less than a millisecond, so that what is measured is Blender and not the looking.
"""

import dataclasses
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

FILE = "Xvfb_screen0"
HEADER = 25          # numbers at the beginning of an XWD file, big-endian
LOOKS_PER_SECOND = 120
SECONDS_TO_DRAW = 0.003   # of one picture by the X server: one that is half drawn is read again


@dataclasses.dataclass(frozen=True)
class Recording:
    """What was seen; times are of ``time.monotonic``."""

    changes: tuple[float, ...]        # when another picture was there
    pictures: tuple[tuple[float, np.ndarray], ...]   # some of them, uint8 (H, W, 3), and when they appeared

    def at(self, moment: float) -> np.ndarray:
        """The picture that was shown at ``moment``."""
        return next(picture for seen, picture in reversed(self.pictures) if seen <= moment)


class Screen:
    """The upper left corner of a virtual screen."""

    def __init__(self, folder: Path, size: tuple[int, int]) -> None:
        path = folder / FILE
        numbers = np.fromfile(path, ">u4", HEADER)
        height, bytes_per_line, colors = int(numbers[5]), int(numbers[12]), int(numbers[19])
        pixels = np.memmap(path, "<u4", "r", int(numbers[0]) + 12 * colors, (height, bytes_per_line // 4))
        self._pixels = pixels[:size[1], :size[0]]

    def record(self, seconds: float, all_until: float, marks: Sequence[float]) -> Recording:
        """Watch for ``seconds``; keep every picture of the first ``all_until``, then those at ``marks`` (seconds)."""
        began = time.monotonic()
        now, shown = np.array(self._pixels), began
        kept, changes, due = [(began, now)], [], sorted(mark for mark in marks if mark > all_until)
        while (passed := time.monotonic() - began) < seconds:
            while due and passed >= due[0]:
                kept.append((shown, now))
                due.pop(0)
            if not np.array_equal(self._pixels, now):
                shown = time.monotonic()
                time.sleep(SECONDS_TO_DRAW)
                now = np.array(self._pixels)
                changes.append(shown)
                if passed < all_until:
                    kept.append((shown, now))
            time.sleep(1 / LOOKS_PER_SECOND)
        kept.append((shown, now))
        return Recording(tuple(changes), tuple((seen, _rgb(pixels)) for seen, pixels in kept))


def _rgb(pixels: np.ndarray) -> np.ndarray:
    return np.stack([(pixels >> shift & 255).astype(np.uint8) for shift in (16, 8, 0)], axis=-1)
