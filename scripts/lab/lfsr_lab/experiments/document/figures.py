"""Figures and tables of every kind of study, drawn from its record alone by the study's own code."""

from __future__ import annotations

import base64
import dataclasses
import re
from collections.abc import Callable
from pathlib import Path

from markupsafe import Markup

from lfsr_core.base.files import read_json
from lfsr_core.base.records import from_data, read_record
from lfsr_lab.experiments.animations import study as animations
from lfsr_lab.experiments.chart import findings, panels
from lfsr_lab.experiments.chart.analysis import read_chart
from lfsr_lab.experiments.denoiser import study as denoiser
from lfsr_lab.experiments.displays import study as displays
from lfsr_lab.experiments.engine import plots
from lfsr_lab.experiments.engine.report import inline_svg, markdown_table
from lfsr_lab.experiments.gpu_budget import study as gpu_budget
from lfsr_lab.experiments.plan_validation import study as plans
from lfsr_lab.experiments.rivals import study as rivals
from lfsr_lab.experiments.scales import study as scales
from lfsr_lab.experiments.scales.study import Table, fit, groups_of
from lfsr_lab.experiments.seed_paper import study as seed_paper
from lfsr_lab.experiments.seed_paper.figure import Results
from lfsr_lab.experiments.sweeps import study as sweeps
from lfsr_lab.experiments.sweeps.records import Report

WIDE = 800  # points
IMAGE = re.compile(r"!\[[^]]*\]\([^)]*?([\w-]+\.png)\)")


@dataclasses.dataclass(frozen=True)
class Drawn:
    title: str
    image: Markup  # SVG, or an image in itself
    words: str = ""  # below it

    @property
    def is_wide(self) -> bool:
        """Whether it has several panels beside each other, so that it needs the page's width."""
        found = re.search(r'viewBox="0 0 ([\d.]+)', self.image)
        return found is not None and float(found[1]) > WIDE


@dataclasses.dataclass(frozen=True)
class Shown:
    figures: list[Drawn]
    tables: str  # Markdown of all values, or HTML made of it
    lead: str = ""  # Markdown of what is said first, or HTML made of it


def shown(kind: str, record: Path, images: Path) -> Shown:
    """Return what a record of this kind of study shows; ``images`` holds those that are no drawings."""
    return KINDS[kind](record, images)


def _chart(record: Path, _images: Path) -> Shown:
    chart = read_chart(record)
    figures = [Drawn(panel.words, inline_svg(panels.drawn(chart, [panel]), panel.words))
               for panel in panels.overview(chart)]
    equal = findings.equal_error(chart)
    table = "\n".join(markdown_table(equal.header, equal.rows, equal.align))
    return Shown(figures, findings.markdown(chart), f"{findings.headline(chart)}\n\n{equal.title}\n\n{table}")


def _sweeps(record: Path, _images: Path) -> Shown:
    report = read_record(record, Report, "parameter sweeps")
    drawn = [(sweep, sweeps.curves(sweep, report.methods)) for sweep in report.sweeps]
    return Shown([Drawn(sweep.name, image, f"{sweep.meaning.capitalize()}; values are {sweep.unit}. A ring marks where "
                        "a method breaks.") for sweep, image in drawn if image], sweeps.markdown(report),
                 sweeps.markdown(report).split("## ")[1].partition("\n\n")[2])


def _animations(record: Path, _images: Path) -> Shown:
    found = read_record(record, animations.Report, "animations").found
    of_each = {animations.TITLES[name]: [each for each in found if each.animation == name]
               for name in dict.fromkeys(each.animation for each in found)}
    return Shown([Drawn(title, inline_svg(plots.svg(animations.chart(of_one)), title), "Split SSIM and flicker by "
                        "samples.") for title, of_one in of_each.items()], animations.markdown(found))


def _displays(record: Path, _images: Path) -> Shown:
    found = read_record(record, displays.Comparison, "a comparison of displays")
    drawn = {"Against every view": displays.WOVEN, "Against the panel's own subpixels": displays.TRACED}
    figures = {title: displays.figure(found, reference) for title, reference in drawn.items()}
    return Shown([Drawn(title, inline_svg(plots.svg(figure), title)) for title, figure in figures.items() if figure],
                 displays.markdown(found))


def _plans(record: Path, _images: Path) -> Shown:
    tables = plans.markdown(read_record(record, plans.Validation, "a validation of plans").plans)
    return Shown([], tables, tables.strip().split("\n\n")[-1])


def _scales(record: Path, _images: Path) -> Shown:
    table = read_record(record, Table, "accuracies and depths of scenes")
    groups = groups_of(table)
    tables = "\n".join(scales.page(groups, fit(groups), table.method))
    return Shown([], tables, tables.split("\n\n")[-2])


def _denoiser(record: Path, _images: Path) -> Shown:
    tables = denoiser.markdown(read_record(record, denoiser.Record, "means of denoisers"))
    return Shown([], tables, "\n\n".join(tables.split("\n\n")[:2]))


def _gpu_budget(record: Path, _images: Path) -> Shown:
    measured = read_record(record, gpu_budget.Record, "measured steps").measured
    text = gpu_budget.markdown(gpu_budget.counts.read_gpus(), measured).partition("\n\n")[2]
    return Shown([], text, text.split("\n## ")[2].partition("\n\n")[2])


def _rivals(record: Path, _images: Path) -> Shown:
    return Shown([], "", rivals.markdown(read_json(record, "methods of others")).partition("\n\n")[2])


def _seed_paper(record: Path, images: Path) -> Shown:
    data = read_json(record, "the figures of a paper")["figures"]
    results = {name: from_data(Results, found, str(record)) for name, found in data.items()}
    known = [(seed_paper.FIGURES[name], found) for name, found in results.items()]
    tables = ["\n".join([f"## {figure.title}", "", f"Claim: {figure.claim}", "", f"Here: {figure.line(found)}", "",
                         *figure.table(found.rows)]) for figure, found in known]
    drawn = []
    for figure, found in known:
        file, words = images / figure.image, f"{figure.claim} {figure.line(found)}"
        if figure.draw and not any(row.image for row in found.rows):
            image = inline_svg(plots.svg(figure.draw(found.rows, images)), figure.title)
            drawn.append(Drawn(figure.title, image, words))
        elif figure.draw and file.exists():
            drawn.append(Drawn(figure.title, embedded(file, figure.title), words))
    return Shown(drawn, "\n\n".join(tables))


def _page(record: Path, images: Path) -> Shown:
    """What a study's own page shows, where no other record of it was kept."""
    _, *parts = re.split(r"^## ", record.read_text(encoding="utf-8"), flags=re.MULTILINE)
    figures = [Drawn(title, embedded(images / image[1], title), (re.findall(r"^Here: (.+)$", part, re.MULTILINE)[0]))
               for part in parts if (title := part.splitlines()[0]) and (image := IMAGE.search(part))]
    return Shown(figures, IMAGE.sub("", "\n".join(f"## {part}" for part in parts)))


def embedded(file: Path, title: str) -> Markup:
    data = base64.b64encode(file.read_bytes()).decode()
    return Markup('<img alt="{}" src="data:image/png;base64,{}">').format(title, data)


KINDS: dict[str, Callable[[Path, Path], Shown]] = {
    "chart": _chart, "sweeps": _sweeps, "animations": _animations, "displays": _displays, "plans": _plans,
    "scales": _scales, "denoiser": _denoiser, "gpu_budget": _gpu_budget,
    "rivals": _rivals, "seed_paper": _seed_paper, "page": _page}
