"""What every figure offers to the script, and the pieces that their tables and pictures share."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from lfsr_core.bench.paper.settings import Settings
from lfsr_core.bench.paper.verdict import Difference, paired

Results = dict[str, Any]
COLORS = ("#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#999999")
DPI = 90
ALIKE = 1.5  # times as many crops as another network has seen
CROPS_SEEN = re.compile(r"^(?P<kind>[^:]*): (?P<epochs>\d+) epochs of (?P<crops>\d+) (?P<size>\d+)-pixel crops per "
                        r"photograph, rate (?P<rate>\S+ \w+),")


@dataclasses.dataclass(frozen=True)
class Figure:
    """One figure or table of the paper.

    ``claim``: what the paper says, as far as it is known here. ``measure(settings,
    cells folder's parent)`` gives plain JSON and goes on where an earlier call was
    stopped; ``draw(results, output, path)`` writes a PNG (None: a table only);
    ``table(results)`` is Markdown; ``line(results)`` says what became of the claim.
    """

    id: str
    title: str
    claim: str
    measure: Callable[[Settings, Path], Results]
    draw: Callable[[Results, Path, Path], None] | None
    table: Callable[[Results], list[str]]
    line: Callable[[Results], str]


def markdown(header: Sequence[object], rows: Sequence[Sequence[object]]) -> list[str]:
    """Lines of a Markdown table."""
    return ["| " + " | ".join(map(str, row)) + " |" for row in (header, ["---"] * len(header), *rows)]


def number(value: float | None, half: float | None = None, digits: int = 3) -> str:
    """A value with its interval where it has one; a dash for what is not known."""
    if value is None:
        return "–"
    return f"{value:.{digits}f}" + (f" ± {half:.{digits}f}" if half else "")


def metric(row: Mapping[str, Any], name: str, digits: int = 3) -> str:
    """One metric of a row of ``quality.measure``."""
    return number(row["metrics"].get(name), row["ci95"].get(name), digits)


def by_name(rows: Sequence[Mapping[str, Any]], *keys: str) -> dict[tuple[Any, ...], Mapping[str, Any]]:
    """Rows that were measured, by the values of ``keys``."""
    return {tuple(row[key] for key in keys): row for row in rows if row.get("metrics")}


def gains(rows: Sequence[Mapping[str, Any]], better: str, worse: str, **where: Any) -> dict[str, Difference]:
    """Split SSIM per foreground lens of method ``better`` over ``worse``, for every scene that has both."""
    chosen = [row for row in rows if all(row.get(key) == value for key, value in where.items())]
    found = by_name(chosen, "scene", "method")
    scenes = dict.fromkeys(scene for scene, _ in found)
    return {scene: paired(found[scene, better]["lens_ssim_fg"], found[scene, worse]["lens_ssim_fg"])
            for scene in scenes if (scene, better) in found and (scene, worse) in found
            and found[scene, better]["lens_ssim_fg"]}


def missing(rows: Sequence[Mapping[str, Any]]) -> str:
    """A clause that names the methods that could not be measured."""
    names = dict.fromkeys(row["method"] for row in rows if not row.get("metrics"))
    return f" Not measured, for want of weights: {', '.join(names)}." if names else ""


def unequal(schedules: Mapping[str, str]) -> str:
    """A clause where the networks compared were not trained alike, as ``models.schedule`` tells it."""
    found = [CROPS_SEEN.search(text) for text in schedules.values() if text != "no weights"]
    if len(found) < 2 or None in found:
        return " How the networks were trained is not known of all." if None in found else ""
    seen = [int(match["epochs"]) * int(match["crops"]) for match in found]
    same_recipe = len({(match["kind"], match["size"], match["rate"]) for match in found}) == 1
    if same_recipe and max(seen) <= ALIKE * min(seen):
        return ""
    return f" The networks were not trained alike: {min(seen)} to {max(seen)} crops of each photograph."


def axes(width: float, height: float, rows: int = 1, columns: int = 1) -> tuple[Any, Any]:
    """A matplotlib figure and its axes, drawn without a window."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as Sheet

    sheet = Sheet(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(sheet)
    return sheet, sheet.subplots(rows, columns, squeeze=False)


def save(sheet: Any, path: Path) -> None:
    """Write the figure as a small PNG, whole or not at all."""
    from lfsr_core.files import atomic_path

    with atomic_path(path) as temporary:
        sheet.savefig(temporary, dpi=DPI, pil_kwargs={"optimize": True})
