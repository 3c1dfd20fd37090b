"""Numbers that documents quote, held against the records that they were read from."""

import dataclasses
import functools
import json
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
NUMBER = r"[−-]?(?:\d[\d,]*\d|\d)?\.?\d+"
MEASURED = re.compile(r"(?<![\w.,/×-])(?:[−+-])?\d*\.\d+(?![\w./]*\w)")  # a number with a point, no version or file
VERSIONS = {"0.1", "3.11", "3.13", "3.14", "4.5", "5.0", "5.1", "5.2"}  # of this project, Python and Blender
INLINE = re.compile(r"`[^`\n]*`")
CODE = re.compile(r"```.*?```|`[^`\n]*`|^    [^\n]*$|\]\([^)]*\)", re.DOTALL | re.MULTILINE)
Values = Sequence[float]


@functools.cache
def record(name: str) -> Any:
    """Return a record of docs/results/measured."""
    return json.loads((ROOT / "docs" / "results" / "measured" / f"{name}.json").read_text(encoding="utf-8"))


@functools.cache
def text_of(document: str) -> str:
    """Return a document in which code and links are blank, so that places stay."""
    return CODE.sub(lambda match: re.sub(r"[^\n`]", " ", match[0]) if "\n" in match[0] or match[0][0] != "`"
                    else match[0], (ROOT / document).read_text(encoding="utf-8"))


def plain(quoted: str) -> float:
    """Return a number as it is quoted, with its minus, plus and commas."""
    return float(quoted.replace("−", "-").replace(",", ""))


def row_numbers(cell: str) -> list[str]:
    """Return the numbers in words or a cell."""
    return re.findall(f"(?<!\\w){NUMBER}", cell)


@dataclasses.dataclass(frozen=True)
class Claim:
    """Words of a document, {} for each number, and what a record says."""

    document: str
    words: str
    values: Callable[[], Values]

    @property
    def place(self) -> re.Match[str]:
        """Where the words stand, once; AssertionError where they do not."""
        parts = [r"\s+".join(map(re.escape, part.split(" "))) for part in self.words.split("{}")]
        matches = list(re.finditer(f"([+]?{NUMBER})".join(parts), text_of(self.document)))
        assert len(matches) == 1, f"{self.document} has {len(matches)} times: {self.words}"
        return matches[0]

    def wrong(self) -> list[tuple[str, float]]:
        """Return the numbers that do not agree, with what the record says."""
        return _wrong(self.place.groups(), self.values())

    def spans(self) -> Iterator[tuple[int, int]]:
        """Yield the places of its numbers."""
        return (self.place.span(index) for index in range(1, len(self.place.groups()) + 1))


@dataclasses.dataclass(frozen=True)
class TableClaim:
    """A table by the start of its header; ``expected`` gets a row's cells and returns the numbers from ``first`` on."""

    document: str
    words: str
    expected: Callable[[list[str]], Values]
    first: int = 1

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """Yield the place of each row, and its cells."""
        text = text_of(self.document)
        assert text.count(f"\n{self.words}") == 1, f"{self.document} has no table, or several: {self.words}"
        start = text.index(f"\n{self.words}") + 1
        for number, line in enumerate(text[start:].split("\n")):
            if not line.startswith("|"):
                return
            if number > 1:
                yield start, [cell.strip() for cell in line.strip("|").split("|")]
            start += len(line) + 1

    def wrong(self) -> list[tuple[str, float]]:
        """Return the numbers that do not agree, with what the record says."""
        disagreeing = list[tuple[str, float]]()
        for _, cells in self.rows():
            values = self.expected(cells)  # may leave out cells
            disagreeing += _wrong([number for cell in cells[self.first:] for number in row_numbers(cell)], values)
        return disagreeing

    def spans(self) -> Iterator[tuple[int, int]]:
        """Yield the places of its rows."""
        return ((start, text_of(self.document).index("\n", start)) for start, _ in self.rows())


def _wrong(quoted: Sequence[str], values: Values) -> list[tuple[str, float]]:
    assert len(quoted) == len(values), f"{len(quoted)} numbers are quoted, {len(values)} known: {quoted} {values}"
    # A value in the middle between two numbers as they are quoted rounds either way.
    return [(number, value) for number, value in zip(quoted, values, strict=True) if value is None
            or abs(plain(number) - value) > 0.5 * 10.0**-len(number.partition(".")[2]) * (1 + 1e-6) + 1e-12]


def uncovered(document: str, claims: Sequence[Claim | TableClaim], without: Sequence[str]) -> list[str]:
    """Return the lines of the numbers with a point that neither a claim nor words of ``without`` cover."""
    text = text_of(document)
    spans = [span for claim in claims if claim.document == document for span in claim.spans()]
    for words in without:
        places = [match.span() for match in re.finditer(r"\s+".join(map(re.escape, words.split())), text)]
        assert places, f"{document} does not say any more: {words}"
        spans += places
    shown = INLINE.sub(lambda match: " " * len(match[0]), text)
    return [f"{match[0]}: {text[text.rfind(chr(10), 0, match.start()) + 1:text.find(chr(10), match.end())]}"
            for match in MEASURED.finditer(shown) if match[0] not in VERSIONS
            and not any(start <= match.start() and match.end() <= end for start, end in spans)]
