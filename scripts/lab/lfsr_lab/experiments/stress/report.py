"""The report of the stability suite: breaking points and figures as stress.json and stress.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lfsr_core.errors import LfsrError
from lfsr_core.records import to_data, write_record
from lfsr_lab.experiments.engine.environment import environment
from lfsr_lab.experiments.engine.report import markdown_table, write_text
from lfsr_lab.experiments.stress.dials import Dial, breaking_point, label
from lfsr_lab.experiments.stress.folder import BASELINE, Bench
from lfsr_lab.experiments.stress.records import FORMAT, Cell, DialReport, Report

REPORT_FILE, TABLE_FILE = "stress.json", "stress.md"
LEGEND = ("A number is the first value of the dial where the method breaks: **b** below bicubic, **s** 0.05 below its "
          "own start. – : it never breaks. ? : nothing could be measured.")


def write_report(bench: Bench, values: Mapping[Dial, Sequence[float]], methods: Sequence[str]) -> Report:
    """Write stress.json and stress.md of measured cells; LfsrError where a cell is missing."""
    dials = tuple(_dial(bench, dial, chosen, methods) for dial, chosen in values.items())
    report = Report(FORMAT, bench.settings, to_data(environment()), tuple(methods), dials)
    write_record(bench.folder / REPORT_FILE, report)
    write_text(bench.folder / TABLE_FILE, markdown(report))
    return report


def _dial(bench: Bench, dial: Dial, values: Sequence[float], methods: Sequence[str]) -> DialReport:
    cells = tuple(_cell(bench, dial, value, method) for value in values for method in methods)
    judged = {method: {cell.value: cell.metrics.get(dial.judged) for cell in cells if cell.method == method}
              for method in methods}
    breaks = {method: breaking_point(values, judged[method], None if method == BASELINE else judged[BASELINE])
              for method in methods}
    return DialReport(dial.name, dial.meaning, dial.unit, dial.judged, tuple(values), cells, breaks)


def _cell(bench: Bench, dial: Dial, value: float, method: str) -> Cell:
    cell = bench.read_cell(dial, value, method)
    if cell is None:
        raise LfsrError(f"{dial.name} {label(value)} of {method} is not measured in {bench.folder}: "
                        "run `lfsr stress` again")
    return cell


def markdown(report: Report) -> str:
    """Breaking points of every method, then the figures of every dial."""
    breaks = [[dial.name, dial.span, *map(dial.break_text, report.methods)] for dial in report.dials]
    lines = ["# Stability suite", "", str(report.settings), "", "## Breaking points", "", LEGEND, "",
             *markdown_table(["dial", "from – to", *report.methods], breaks)]
    for dial in report.dials:
        lines += ["", f"## {dial.name}", "", f"{dial.meaning.capitalize()}; values are {dial.unit}.", ""]
        for metric in dial.shown:
            lines += [*_metric_table(dial, report.methods, metric), ""]
    return "\n".join(lines).rstrip() + "\n"


def _metric_table(dial: DialReport, methods: Sequence[str], metric: str) -> list[str]:
    """One metric by value and method, beside the reference's own noise where that is of the same kind."""
    columns = {method: dial.series(method, metric) for method in methods}
    if metric == dial.judged:
        columns["ssim_ceiling"] = dial.series(methods[0], "ssim_ceiling")
    return markdown_table([metric, *columns], zip(map(label, dial.values), *columns.values(), strict=True))
