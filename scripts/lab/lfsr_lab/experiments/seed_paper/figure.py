"""What every figure of the paper is made of: cells that measure rows, a table, a sentence and an image."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from lfsr_core.metrics.eia_metrics import student_95
from lfsr_lab.experiments.engine import plots
from lfsr_lab.experiments.engine.records import Cell, Records, measured
from lfsr_lab.experiments.engine.report import markdown_table
from lfsr_lab.experiments.seed_paper.measuring import (
    CELLS,
    LENS_SSIM,
    NONE,
    VERSION,
    Results,
    Row,
    Rows,
    Settings,
    schedules,
    store,
)

FEWEST = 3  # values that show their own spread
SINGLE_RUN = 0.10  # fraction of a time taken once that is within its noise
WORDS = {1: "holds", -1: "the other way round", 0: "cannot be told"}


@dataclasses.dataclass(frozen=True)
class Difference:
    value: float  # the difference itself
    half: float = 0.0  # half-width of the interval, infinite where the spread is not known

    @property
    def sign(self) -> int:
        """1 above zero, -1 below, 0 where the interval holds zero."""
        return int(self.value - self.half > 0) - int(self.value + self.half < 0)

    def __str__(self) -> str:
        return f"{self.value:+.3g}" + (f" ± {self.half:.2g}" if 0 < self.half < math.inf else "")


Differences = Mapping[str, Difference]  # by the case's name


def paired(ours: Sequence[float], theirs: Sequence[float]) -> Difference:
    """Return the mean of ``ours`` - ``theirs``, pair by pair, with its interval of Student's t."""
    values = [a - b for a, b in zip(ours, theirs, strict=True)]
    count = len(values)
    mean = math.fsum(values) / count
    if count < FEWEST:
        return Difference(mean, math.inf)
    variance = math.fsum((value - mean) ** 2 for value in values) / (count - 1)
    return Difference(mean, student_95(count - 1) * math.sqrt(variance / count))


def single_runs(ours: float, theirs: float) -> Difference:
    """Return ``ours`` - ``theirs`` of two times that were each taken once."""
    return Difference(ours - theirs, SINGLE_RUN * max(ours, theirs))


def overall(*parts: Differences) -> str:
    """Return in bold what became of a claim whose ``parts`` must all be above zero."""
    signs = {difference.sign for part in parts for difference in part.values()}
    if not signs:
        return "**Not measured.**"
    if 1 in signs:
        words = "Holds" if signs == {1} else "Holds in part"
    else:
        words = "Does not hold" if -1 in signs else "Cannot be told"
    return f"**{words}.**" if all(parts) else f"**{words}; not all of it was measured.**"


def sentence(statement: str, differences: Differences, unit: str = "") -> str:
    """Return whether the statement that the differences are above zero holds, where, and by how much in ``unit``."""
    if not differences:
        return f"{statement}: not measured."
    return f"{statement}: {holds(differences)} ({span(differences)} {unit}".rstrip() + ")."


def holds(differences: Differences) -> str:
    """Return whether "above zero" holds: in all cases, or in which."""
    total, parts = len(differences), []
    for sign, words in WORDS.items():
        names = [name for name, difference in differences.items() if difference.sign == sign]
        if len(names) == total:
            return words + (f" (all {total} cases)" if total > 1 else "")
        if names:
            parts.append(f"{words} in {len(names)} of {total} ({', '.join(names)})")
    return "; ".join(parts)


def span(differences: Differences) -> str:
    """Return a single difference with its interval, several as a range."""
    ordered = sorted(differences.values(), key=lambda difference: difference.value)
    return str(ordered[0]) if len(ordered) == 1 else f"{ordered[0].value:+.3g} to {ordered[-1].value:+.3g}"


@dataclasses.dataclass(frozen=True)
class Figure:
    id: str  # on the command line and in file names
    title: str  # on the page
    claim: str  # what the paper says, as far as it is known here
    cells: Callable[[Settings], Iterable[Cell[Rows]]]  # what is measured
    columns: tuple[str, ...]  # values in the table
    rule: Callable[[Sequence[Row]], str]  # what became of the claim, in words
    # Image of the rows and of the files in the folder of their measurements; None for a table only.
    draw: Callable[[Sequence[Row], Path], plots.Figure] | None = None
    methods: tuple[str, ...] = ()  # those whose training matters

    @property
    def image(self) -> str:
        return f"paper-{self.id}.png"

    def measure(self, settings: Settings) -> Results:
        """Measure what an earlier call has not measured yet, and return everything."""
        records = Records(settings.output / CELLS / self.id, Rows)
        wanted = (dataclasses.replace(cell, inputs={"version": VERSION, **cell.inputs})
                  for cell in self.cells(settings))
        rows = [row for record in measured(wanted, records, store(settings)) for row in record.rows]
        return Results(tuple(rows), records.load, schedules(settings, self.methods))

    def table(self, rows: Iterable[Row]) -> list[str]:
        """Return the lines of a Markdown table of the rows that have values."""
        shown = [row for row in rows if row.values]
        labels = [name for name in ("scene", "method", "how", "samples") if any(getattr(row, name) for row in shown)]
        lines = [[*(getattr(row, name) or None for name in labels), *map(row.text, self.columns)] for row in shown]
        return markdown_table([*labels, *self.columns], lines)

    def line(self, results: Results) -> str:
        """Return what became of the claim, and what the results lack."""
        absent = ", ".join(dict.fromkeys(row.method for row in results.rows if not row.has_weights))
        without = f" Not measured, because they have no weights: {absent}." if absent else ""
        # Seconds and device do not count.
        recipes = {text.rpartition(", ")[0] for text in results.schedules.values() if text != NONE}
        unequal = " The networks were not trained alike, or it is not recorded how."
        return self.rule(results.rows) + without + (unequal if len(recipes) > 1 or "" in recipes else "")


def gains(rows: Iterable[Row], more: str, less: str, series: str = LENS_SSIM) -> dict[str, Difference]:
    """Return what method ``more`` has more than ``less`` in a series, for every scene that has both."""
    values = {(row.scene, row.method): row.series[series] for row in rows if row.series.get(series)}
    return {scene: paired(ours, values[scene, less]) for (scene, method), ours in values.items()
            if method == more and (scene, less) in values}


def scenes_of(rows: Iterable[Row]) -> list[str]:
    return list(dict.fromkeys(row.scene for row in rows if row.scene))
