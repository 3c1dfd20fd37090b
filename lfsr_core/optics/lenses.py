"""Rows of lenses: the part of an EIA that one of several machines renders.

Rows count from 1 at the top; the last row is included, as in a frame range.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError

Rows = tuple[int, int]  # first and last
RANGE = re.compile(r"(\d{1,9})(?:([-/])(\d{1,9}))?$")
LENSES_PER_BACKGROUND = 8  # one chosen lens in eight is background: it finds foreground that the mask missed
BITS = 16


def parse_rows(text: str, count: int) -> Rows:
    """Return the rows that ``text`` names: ``A-B``, one row ``A``, or ``K/N``, the Kth of N nearly equal parts.

    ``count`` is the number of rows of the display. LfsrError if it does not have these rows.
    """
    found = RANGE.match(text.strip())
    if found is None:
        raise LfsrError(f"rows are {text[:30]!r}, but they must be A-B, as in 1-{count}, or K/N, as in 1/4")
    first, last = int(found[1]), int(found[3] or found[1])
    if found[2] == "/":
        if not 1 <= first <= last <= count:
            raise LfsrError(f"rows are {text.strip()}, but the display has {count} rows of lenses: give K/N with K "
                            f"from 1 to N, and N at most {count}")
        return (first - 1) * count // last + 1, first * count // last
    check_rows((first, last), count)
    return first, last


def check_rows(rows: Rows, count: int) -> None:
    """LfsrError unless a display with ``count`` rows of lenses has ``rows``."""
    if not 1 <= rows[0] <= rows[1] <= count:
        raise LfsrError(f"rows are {rows[0]}-{rows[1]}, but the display has rows of lenses 1-{count}: give rows "
                        "within these")


def pixel_rows(rows: Rows, height: int) -> tuple[int, int]:
    """First pixel row, and the one after the last, in an EIA with ``height`` pixels per lens."""
    return (rows[0] - 1) * height, rows[1] * height


def check_cover(parts: Iterable[Rows], count: int) -> None:
    """LfsrError unless ``parts``, in any order, cover each of the rows 1 to ``count`` once."""
    at = 0
    for first, last in [*sorted(parts), (count + 1, count)]:
        if first > at + 1:
            raise LfsrError(f"rows {rows_text((at + 1, first - 1))} are in none of the parts: render them with "
                            f"--rows {at + 1}-{first - 1}, or name their folder too")
        if first <= at:
            raise LfsrError(f"rows {rows_text((first, min(last, at)))} are in more than one part: leave one of the "
                            "parts out")
        at = last


def rows_text(rows: Rows) -> str:
    """Rows as in a sentence: "3" or "3-5"."""
    return str(rows[0]) if rows[0] == rows[1] else f"{rows[0]}-{rows[1]}"


def choose_lenses(mask: Array, count: int, seed: int = 0) -> tuple[tuple[int, int], ...]:
    """Return ``count`` different random lenses, (row, column), in reading order.

    ``mask`` (sy, sx) bool is the foreground. One lens in eight is background where there is
    any; of eight or more lenses at least two are, because one alone has no spread. The others
    are foreground. Every lens of a group is equally likely. LfsrError if fewer than ``count`` lenses exist.
    """
    check_count(count, mask.size)
    foreground, background = np.argwhere(mask), np.argwhere(~mask)
    most = max(2, count // LENSES_PER_BACKGROUND) if count >= LENSES_PER_BACKGROUND else 0
    wanted = min(count - min(len(background), most), len(foreground))
    random = np.random.default_rng(seed)
    chosen = np.concatenate([systematic_sample(foreground, wanted, random),
                             systematic_sample(background, count - wanted, random)])
    return tuple(sorted((int(row), int(column)) for row, column in chosen))


def check_count(count: int, lenses: int) -> None:
    """LfsrError unless ``count`` is from 1 to the number of ``lenses`` of a display."""
    if not 1 <= count <= lenses:
        raise LfsrError(f"number of lenses is {str(count)[:20]}, but it must be from 1 to the display's {lenses}")


def systematic_sample(lenses: Array, count: int, random: np.random.Generator) -> Array:
    """Return ``count`` of ``lenses`` (n, 2), row and column, spread evenly: equal steps along a Z-order curve.

    The start is random, so every lens is equally likely.
    """
    bits = (lenses[:, :, None] >> np.arange(BITS)) & 1
    z_order = (bits * 4 ** np.arange(BITS)).sum(-1) @ np.array([2, 1])
    places = (np.arange(count) + random.random()) * (len(lenses) / max(count, 1))
    chosen: Array = lenses[np.argsort(z_order)][np.minimum(places.astype(int), len(lenses) - 1)]
    return chosen
