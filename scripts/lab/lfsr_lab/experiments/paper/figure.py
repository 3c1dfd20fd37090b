"""What every figure of the paper offers to the script, and the pieces that their tables and sentences share."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Generic, TypeVar

from lfsr_lab.experiments.engine import plots
from lfsr_lab.experiments.engine.accuracy import MAIN_METRICS
from lfsr_lab.experiments.engine.report import number
from lfsr_lab.experiments.paper.records import Results, Row
from lfsr_lab.experiments.paper.settings import Settings
from lfsr_lab.experiments.paper.verdict import Difference, paired

Measured = TypeVar("Measured", bound=Results)
ALIKE = 1.5  # times as many crops as another network has seen
CROPS_SEEN = re.compile(r"^(?P<kind>[^:]*): (?P<epochs>\d+) epochs of (?P<crops>\d+) (?P<size>\d+)-pixel crops per "
                        r"photograph, rate (?P<rate>\S+ \w+),")


@dataclasses.dataclass(frozen=True)
class Figure(Generic[Measured]):
    """One figure or table of the paper."""

    id: str  # on the command line and in file names
    title: str  # on the page
    claim: str  # what the paper says, as far as it is known here
    kind: type[Measured]  # class of its results
    measure: Callable[[Settings], Measured]  # makes the results, and goes on where an earlier call was stopped
    table: Callable[[Measured], list[str]]  # Markdown lines of the results
    line: Callable[[Measured], str]  # what became of the claim, in words
    # A picture of the results and of files in the output folder; None for a table only.
    draw: Callable[[Measured, Path], plots.Figure] | None = None


def metric(row: Row, name: str, digits: int = 3) -> str:
    """One metric that was measured, with its interval where it has one."""
    return number((row.metrics or {}).get(name), row.ci95.get(name), digits)


def known(rows: Iterable[Any], names: Iterable[str]) -> list[str]:
    """Those of ``names`` that a row has: of a reference that shows every lens, or of one that shows some."""
    found = [row.metrics for row in rows if row.metrics]
    return [name for name in names if any(metrics.get(name) is not None for metrics in found)]


def main_metric(rows: Sequence[Any]) -> str:
    """What accuracy is drawn: ``ssim_eia_fg``, or ``ssim_lens_fg`` where a row's reference shows only some lenses."""
    return next((name for name in MAIN_METRICS
                 if all(name in row.metrics for row in rows if row.metrics)), MAIN_METRICS[0])


def measured(rows: Iterable[Any]) -> dict[tuple[str, str], Any]:
    """Return the rows that have figures, by scene and method."""
    return {(row.scene, row.method): row for row in rows if row.is_measured}


def differences(rows: Iterable[Any], first: str, second: str,
                values: Callable[[Any], Sequence[float]]) -> dict[str, Difference]:
    """What method ``first`` has more than ``second``, for every scene where both were measured.

    Parameters
    ----------
    rows: of any methods and scenes.
    first, second: names of methods.
    values: of a row, as many and in the same order for both methods.
    """
    found = {key: values(row) for key, row in measured(rows).items()}
    return {scene: paired(ours, found[scene, second]) for (scene, method), ours in found.items()
            if method == first and ours and found.get((scene, second))}


def gains(rows: Iterable[Row], better: str, worse: str) -> dict[str, Difference]:
    """Split SSIM per foreground lens of method ``better`` over ``worse``, for every scene that has both."""
    return differences(rows, better, worse, lambda row: row.lens_ssim_fg)


def scenes_of(rows: Iterable[Any]) -> list[str]:
    """Names of the rows' scenes, each once."""
    return list(dict.fromkeys(row.scene for row in rows))


def cautions(rows: Iterable[Any], schedules: Mapping[str, str]) -> str:
    """Clauses that name the methods that could not be measured, and networks that were not trained alike."""
    names = dict.fromkeys(row.method for row in rows if not row.is_measured)
    return (f" Not measured, for want of weights: {', '.join(names)}." if names else "") + _unequal(schedules)


def _unequal(schedules: Mapping[str, str]) -> str:
    """A clause where the networks compared were not trained alike, by what ``weights.schedule`` says of each."""
    found = [CROPS_SEEN.search(text) for text in schedules.values() if text != "no weights"]
    if len(found) < 2 or None in found:
        return " How the networks were trained is not known of all." if None in found else ""
    matches = [match for match in found if match]
    seen = [int(match["epochs"]) * int(match["crops"]) for match in matches]
    same_recipe = len({(match["kind"], match["size"], match["rate"]) for match in matches}) == 1
    if same_recipe and max(seen) <= ALIKE * min(seen):
        return ""
    return f" The networks were not trained alike: {min(seen)} to {max(seen)} crops of each photograph."
