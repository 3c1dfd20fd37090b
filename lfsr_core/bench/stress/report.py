"""The suite's figures as stress.json and stress.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lfsr_core.bench.environment import environment
from lfsr_core.bench.stress.dials import Break, Dial, breaking_point, label
from lfsr_core.bench.stress.folder import BASELINE, FORMAT, Bench, read_cell
from lfsr_core.errors import LfsrError
from lfsr_core.files import atomic_path, write_json
from lfsr_core.records import to_data

REPORT_FILE, TABLE_FILE = "stress.json", "stress.md"
MARKS = {"below bicubic": "b", "below its start": "s"}
LEGEND = ("A number is the first value of the dial where the method breaks: **b** below bicubic, **s** 0.05 below its "
          "own start. – : it never breaks. ? : nothing could be measured.")
# Figures of some dials beside the judged one.
EXTRAS = {"border": ("rmse_border", "rmse_centre", "border_ratio", "ssim_centre"),
          "motion": ("flicker_fixed", "flicker_changing", "ssim_eia_fg"),
          "eye": ("neighbour_error", "ssim_eia_fg"), "recall": ("ssim_eia_fg",), "wire": ("recall",), "share": ("p",)}


def write_report(bench: Bench, values: Mapping[Dial, Sequence[float]], methods: Sequence[str]) -> Path:
    """Write stress.json and stress.md of measured cells; path of the former. LfsrError where a cell is missing."""
    dials = [_dial(bench, dial, chosen, methods) for dial, chosen in values.items()]
    report = {"format": FORMAT, "settings": bench.settings.to_dict(), "environment": to_data(environment()),
              "methods": list(methods), "dials": dials}
    path = bench.folder / REPORT_FILE
    write_json(path, report)
    with atomic_path(bench.folder / TABLE_FILE) as temporary:
        temporary.write_text(markdown(report), encoding="utf-8")
    return path


def _dial(bench: Bench, dial: Dial, values: Sequence[float], methods: Sequence[str]) -> dict[str, Any]:
    cells = [_cell(bench, dial, value, method) for value in values for method in methods]
    quality = {method: {cell["value"]: cell["metrics"].get(dial.judged) for cell in cells if cell["method"] == method}
               for method in methods}
    breaks = {method: _break(values, quality, method) for method in methods}
    return {"name": dial.name, "meaning": dial.meaning, "unit": dial.unit, "judged": dial.judged,
            "values": list(values), "cells": cells, "breaks": breaks}


def _cell(bench: Bench, dial: Dial, value: float, method: str) -> dict[str, Any]:
    cell = read_cell(bench, dial, value, method)
    if cell is None:
        raise LfsrError(f"{dial.name} {label(value)} of {method} is not measured in {bench.folder}: "
                        "run `lfsr stress` again")
    return cell


def _break(values: Sequence[float], quality: dict[str, dict[float, float | None]],
           method: str) -> dict[str, Any] | None:
    found = breaking_point(values, quality[method], None if method == BASELINE else quality[BASELINE])
    return None if found is None else as_dict(found)


def as_dict(found: Break) -> dict[str, Any]:
    """A break as JSON data."""
    return {"value": found.value, "quality": found.quality, "reason": found.reason}


def series(dial: dict[str, Any], method: str, metric: str) -> list[float | None]:
    """One metric of one method along a dial of the report."""
    by_value = {cell["value"]: cell["metrics"].get(metric) for cell in dial["cells"] if cell["method"] == method}
    return [by_value[value] for value in dial["values"]]


def break_text(dial: dict[str, Any], method: str) -> str:
    """How a table shows where ``method`` breaks."""
    if not any(value is not None for value in series(dial, method, dial["judged"])):
        return "?"
    found = dial["breaks"][method]
    return "–" if found is None else f"{label(found['value'])} {MARKS[found['reason']]}"


def markdown(report: dict[str, Any]) -> str:
    """Breaking points of every method, then the judged figure of every dial."""
    methods, settings = report["methods"], report["settings"]
    lines = ["# Stability suite", "", made_with(settings), "", "## Breaking points", "", LEGEND, "",
             *_table(["dial", "from – to", *methods],
                     [[dial["name"], f"{label(dial['values'][0])} – {label(dial['values'][-1])}",
                       *(break_text(dial, method) for method in methods)] for dial in report["dials"]])]
    for dial in report["dials"]:
        lines += ["", f"## {dial['name']}", "", f"{dial['meaning'].capitalize()}; values are {dial['unit']}.", ""]
        for metric in (dial["judged"], *EXTRAS.get(dial["name"], ())):
            lines += [*metric_table(dial, methods, metric), ""]
    return "\n".join(lines).rstrip() + "\n"


def made_with(settings: dict[str, Any]) -> str:
    """One sentence on display, references and frames."""
    display = settings["display"]
    return (f"Display {display['name']}, {display['lenses'][0]}×{display['lenses'][1]} lenses of "
            f"{display['views'][0]}×{display['views'][1]} views, s = {settings['scale']}; references of "
            f"{settings['reference_samples']} samples in two halves; 16 samples per pixel unless the dial says "
            f"otherwise; {settings['frames']} frames of motion.")


def metric_table(dial: dict[str, Any], methods: Sequence[str], metric: str) -> list[str]:
    """One metric by value and method, beside the reference's own noise where that is of the same kind."""
    rows = [[label(value), *(number(series(dial, method, metric)[index]) for method in methods)]
            for index, value in enumerate(dial["values"])]
    ceiling = series(dial, methods[0], "ssim_ceiling")
    if metric == dial["judged"]:
        rows = [[*row, number(ceiling[index])] for index, row in enumerate(rows)]
    return _table([metric, *methods, *(["ssim_ceiling"] if metric == dial["judged"] else [])], rows)


def number(value: float | None) -> str:
    """Three digits behind the point, or a dash."""
    return "–" if value is None else f"{value:.3f}"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    return ["| " + " | ".join(map(str, row)) + " |" for row in (head, ["---"] * len(head), *rows)]
