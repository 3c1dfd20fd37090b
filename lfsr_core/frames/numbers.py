"""Frame numbers: as people write them, and a few that are spread over many."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.request import MOST_FRAME

RANGE = re.compile(r"(-?\d{1,8})(?:-(-?\d{1,8})(?:[x:](\d{1,8}))?)?$")
MOST_FRAMES = 100_000
MOST_SPREAD = 5


def parse_frames(text: str) -> tuple[int, ...]:
    """Return the frames of ``1-48``, ``1-48x2`` (every second one), ``7``, or several of these with commas; each once.

    OpenJD writes ``1-48:2`` for ``1-48x2``.

    LfsrError for any other ``text``.
    """
    frames: dict[int, None] = {}
    for word in text.split(","):
        word = word.strip()
        found = RANGE.match(word)
        if found is None:
            raise LfsrError(f"frames are {text[:50]!r}, but they must be like 1-48, 1-48x2 or 1,5,9")
        first, last, step = int(found[1]), int(found[2] or found[1]), int(found[3] or 1)
        if first > last or not step:
            raise LfsrError(f"frames are {word}, but the first number must be the smaller one and the step at least 1")
        if max(abs(first), abs(last)) > MOST_FRAME:
            raise LfsrError(f"frames are {word}, but they must be between -{MOST_FRAME} and {MOST_FRAME}")
        frames |= dict.fromkeys(range(first, last + 1, step))
        if len(frames) > MOST_FRAMES:
            raise LfsrError(f"frames {text[:30]} are more than {MOST_FRAMES}: render them in several runs")
    return tuple(frames)


def spread(frames: Sequence[int], most: int = MOST_SPREAD) -> tuple[int, ...]:
    """Return at most ``most`` of ``frames``, evenly spread over them, with the first and the last."""
    places = np.linspace(0, len(frames) - 1, min(len(frames), most))
    return tuple(frames[round(place)] for place in places)
