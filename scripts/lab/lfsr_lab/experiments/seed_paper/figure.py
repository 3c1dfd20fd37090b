"""What every figure of the paper is made of: cells that measure rows, a table, a sentence and an image."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from lfsr_lab.experiments.engine import cells, plots
from lfsr_lab.experiments.engine.accuracy import Figures as Numbers
from lfsr_lab.experiments.engine.cells import Cell
from lfsr_lab.experiments.engine.records import Records
from lfsr_lab.experiments.engine.report import markdown_table, number
from lfsr_lab.experiments.seed_paper import renders, weights
from lfsr_lab.experiments.seed_paper.settings import CELLS, VERSION, Settings
from lfsr_lab.experiments.seed_paper.verdict import Difference, paired

LENS_SSIM, SECONDS = "split SSIM of lenses", "seconds"  # names of series
ACCURACY = "ssim_eia_fg"  # the metric that is drawn: split SSIM of the foreground
LARGE = 100  # numbers from here on have no decimals


@dataclasses.dataclass(frozen=True, kw_only=True)
class Row:
    """One row of a figure's table, and what it is compared by."""

    scene: str = ""  # its name, or that of the case
    method: str = ""  # its name, or that of the row
    how: str = ""  # how it was made, where the method does not tell
    samples: int | None = None  # per pixel of the render
    values: Numbers = dataclasses.field(default_factory=dict)  # by column; empty where nothing was measured
    # One number per foreground lens, row of lenses or run; those of two methods are compared pair by pair.
    series: dict[str, tuple[float, ...]] = dataclasses.field(default_factory=dict)
    image: str | None = None  # file name, in the folder of the figure's measurements
    has_weights: bool = True  # False: nothing was measured

    def value(self, name: str) -> float:
        """Return a value, 0 where it is not known."""
        return self.values.get(name) or 0.0

    def text(self, name: str) -> str:
        """Return a value as the table shows it."""
        value = self.values.get(name)
        return number(value, digits=3 if value is None or abs(value) < LARGE else 0)


@dataclasses.dataclass(frozen=True)
class Rows:
    """What one cell measures at once."""

    rows: tuple[Row, ...]


@dataclasses.dataclass(frozen=True)
class Results:
    """All rows of a figure."""

    rows: tuple[Row, ...]
    load: float | None = None  # highest load average seen after any measurement, None where the system tells none
    schedules: dict[str, str] = dataclasses.field(default_factory=dict)  # how each method's network was trained


@dataclasses.dataclass(frozen=True)
class Figure:
    """One figure or table of the paper."""

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
        """File name of its image."""
        return f"paper-{self.id}.png"

    def measure(self, settings: Settings) -> Results:
        """Measure what an earlier call has not measured yet, and return everything."""
        records = Records(settings.output / CELLS / self.id, Rows)
        wanted = (dataclasses.replace(cell, inputs={"version": VERSION, **cell.inputs})
                  for cell in self.cells(settings))
        found = [row for each in cells.measured(wanted, records, renders.store(settings)) for row in each.rows]
        return Results(tuple(found), records.load, weights.schedules(settings, self.methods))

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
        return self.rule(results.rows) + without + _unequal(results.schedules.values())


def _unequal(schedules: Iterable[str]) -> str:
    """Return a caution where the networks were not trained alike; seconds and device do not count."""
    recipes = {text.rpartition(", ")[0] for text in schedules if text != weights.NONE}
    unequal = len(recipes) > 1 or "" in recipes
    return " The networks were not trained alike, or it is not recorded how." if unequal else ""


def gains(rows: Iterable[Row], more: str, less: str, series: str = LENS_SSIM) -> dict[str, Difference]:
    """Return what method ``more`` has more than ``less`` in a series, for every scene that has both."""
    found = {(row.scene, row.method): row.series[series] for row in rows if row.series.get(series)}
    return {scene: paired(ours, found[scene, less]) for (scene, method), ours in found.items()
            if method == more and (scene, less) in found}


def scenes_of(rows: Iterable[Row]) -> list[str]:
    """Return the names of the rows' scenes, each once."""
    return list(dict.fromkeys(row.scene for row in rows if row.scene))
