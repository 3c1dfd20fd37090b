"""The one Markdown table, and how its numbers are written."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

UNKNOWN = "–"
RULES = {"l": "---", "r": "---:"}  # below the header, by a column's letter


def markdown_table(header: Sequence[object], rows: Iterable[Sequence[object]], align: str = "") -> list[str]:
    """Lines of a Markdown table; cells that are not text are written by ``cell_text``.

    ``align`` has a letter per column from the left, "l" or "r"; columns behind its end are as its last letter says,
    and all are "l" without one.
    """
    letters = align.ljust(len(header), align[-1:] or "l")
    return [_line(header), _line([RULES[letter] for letter in letters[:len(header)]]), *map(_line, rows)]


def cell_text(value: object) -> str:
    """A value as a table shows it: a dash for None, yes and no, three digits behind the point of a float."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return number(value) if value is None or isinstance(value, float) else str(value)


def number(value: float | None, half: float | None = None, digits: int = 3) -> str:
    """A number, with the half-width of its interval where it has one; a dash for None."""
    if value is None:
        return UNKNOWN
    return f"{value:.{digits}f}" + (f" ± {half:.{digits}f}" if half else "")


def count(value: float | None) -> str:
    """A whole number with commas between its thousands; a dash for None."""
    return UNKNOWN if value is None else f"{value:,.0f}"


def _line(cells: Iterable[object]) -> str:
    return "| " + " | ".join(map(cell_text, cells)) + " |"
