"""Rows of lenses: the part of an EIA that one of several machines renders.

Rows count from 1 at the top; the last row is included, as in a frame range.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from lfsr_core.base.errors import LfsrError

Rows = tuple[int, int]  # first and last
RANGE = re.compile(r"(\d{1,9})(?:([-/])(\d{1,9}))?$")


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
    for first, last in sorted(parts):
        if first > at + 1:
            raise _missing(at + 1, first - 1)
        if first <= at:
            raise LfsrError(f"rows {rows_text((first, min(last, at)))} are in more than one part: leave one of the "
                            "parts out")
        at = last
    if at < count:
        raise _missing(at + 1, count)


def _missing(first: int, last: int) -> LfsrError:
    return LfsrError(f"rows {rows_text((first, last))} are in none of the parts: render them with "
                     f"--rows {first}-{last}, or name their folder too")


def rows_text(rows: Rows) -> str:
    """Rows as in a sentence: "3" or "3-5"."""
    return str(rows[0]) if rows[0] == rows[1] else f"{rows[0]}-{rows[1]}"
