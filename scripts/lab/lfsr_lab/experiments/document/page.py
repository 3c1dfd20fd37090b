"""The report: every study's figures with their commands, tables, and the manifest, as one HTML file and a PDF."""

from __future__ import annotations

import base64
import dataclasses
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup, escape

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.records import from_data, read_record
from lfsr_core.base.system import atomic_path, read_json
from lfsr_lab.experiments.animations import study as animations
from lfsr_lab.experiments.chart import findings, panels
from lfsr_lab.experiments.chart.analysis import read_chart
from lfsr_lab.experiments.denoiser import study as denoiser
from lfsr_lab.experiments.displays import study as displays
from lfsr_lab.experiments.document.work import Kept, Study
from lfsr_lab.experiments.engine import plots
from lfsr_lab.experiments.engine.report import inline_svg, markdown_table, page_html, write_drawn
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
        match = re.search(r'viewBox="0 0 ([\d.]+)', self.image)
        return match is not None and float(match[1]) > WIDE


@dataclasses.dataclass(frozen=True)
class Shown:
    figures: list[Drawn]
    tables: str  # Markdown of all values, or HTML made of it
    lead: str = ""  # Markdown of what is said first, or HTML made of it


def _chart(record: Path, _images: Path) -> Shown:
    chart = read_chart(record)
    better = "Lower and further left is better."
    figures = [Drawn(panel.words, inline_svg(panels.drawn(chart, [panel]), panel.words), better)
               for panel in panels.overview(chart)]
    equal = findings.equal_error(chart)
    table = "\n".join(markdown_table(equal.header, equal.rows, equal.align))
    return Shown(figures, findings.markdown(chart), f"{findings.headline(chart)}\n\n{equal.title}\n\n{table}")


def _sweeps(record: Path, _images: Path) -> Shown:
    report = read_record(record, Report, "parameter sweeps")
    drawn = [(sweep, sweeps.curves(sweep, report.methods)) for sweep in report.sweeps]
    return Shown([Drawn(sweep.name, image, f"{sweep.meaning.capitalize()}; values are {sweep.unit}. Higher is better; "
                        "a ring marks where a method breaks.") for sweep, image in drawn if image],
                 sweeps.markdown(report),
                 sweeps.markdown(report).split("## ")[1].partition("\n\n")[2])


def _animations(record: Path, _images: Path) -> Shown:
    rows = read_record(record, animations.Report, "animations").rows
    by_title = {animations.TITLES[name]: [row for row in rows if row.animation == name]
                for name in dict.fromkeys(row.animation for row in rows)}
    words = "Split SSIM (higher is better) and flicker (lower is better) by samples."
    return Shown([Drawn(title, inline_svg(plots.svg(animations.chart(own)), title), words)
                  for title, own in by_title.items()], animations.markdown(rows))


def _displays(record: Path, _images: Path) -> Shown:
    comparison = read_record(record, displays.Comparison, "a comparison of displays")
    drawn = {"Against every view": displays.WOVEN, "Against the panel's own subpixels": displays.TRACED}
    figures = {title: displays.figure(comparison, reference) for title, reference in drawn.items()}
    return Shown([Drawn(title, inline_svg(plots.svg(figure), title)) for title, figure in figures.items() if figure],
                 displays.markdown(comparison))


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
    text = gpu_budget.markdown(gpu_budget.read_gpus(), measured).partition("\n\n")[2]
    return Shown([], text, text.split("\n## ")[2].partition("\n\n")[2])


def _rivals(record: Path, _images: Path) -> Shown:
    return Shown([], "", rivals.markdown(read_json(record, "methods of others")).partition("\n\n")[2])


def _seed_paper(record: Path, images: Path) -> Shown:
    data = read_json(record, "the figures of a paper")["figures"]
    results = {name: from_data(Results, entry, str(record)) for name, entry in data.items()}
    figures = [(seed_paper.FIGURES[name], measured) for name, measured in results.items()]
    tables = ["\n".join([f"## {figure.title}", "", f"Claim: {figure.claim}", "", f"Here: {figure.line(measured)}", "",
                         *figure.table(measured.rows)]) for figure, measured in figures]
    drawn = []
    for figure, measured in figures:
        file, words = images / figure.image, f"{figure.claim} {figure.line(measured)}"
        if figure.draw and not any(row.image for row in measured.rows):
            image = inline_svg(plots.svg(figure.draw(measured.rows, images)), figure.title)
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


# What a record of this kind of study shows; the second path has the images that are no drawings.
KINDS: dict[str, Callable[[Path, Path], Shown]] = {
    "chart": _chart, "sweeps": _sweeps, "animations": _animations, "displays": _displays, "plans": _plans,
    "scales": _scales, "denoiser": _denoiser, "gpu_budget": _gpu_budget,
    "rivals": _rivals, "seed_paper": _seed_paper, "page": _page}


PAGE, PRINTED = "report.html", "report.pdf"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome", "msedge")
FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer")  # no sandbox: it may run as root
SECONDS_TO_PRINT = 180


@dataclasses.dataclass(frozen=True)
class Section:
    id: str
    study: Study
    of: Kept
    shown: Shown
    failure: str = ""  # why it could not be drawn


def section(study: Study, kept: Kept, record: Path, images: Path) -> Section:
    """Draw one record; what cannot be drawn says so in its place, so that the others are shown."""
    name = re.sub(r"\W+", "-", kept.file).strip("-")
    try:
        shown = KINDS[kept.kind or study.kind](record, images)
        figures = [dataclasses.replace(figure, image=_own_ids(figure.image, f"{name}-{number}-"))
                   for number, figure in enumerate(shown.figures)]
        shown = dataclasses.replace(shown, figures=figures, tables=html(shown.tables), lead=html(shown.lead))
        return Section(name, study, kept, shown)
    except Exception as error:  # of a library, or a record of another time
        return Section(name, study, kept, Shown([], html("")), f"{type(error).__name__}: {error}")


def write(folder: Path, manifest: Mapping[str, Any], sections: Sequence[Section]) -> Path:
    """Write report.html into ``folder`` and return its path; LfsrError, after it is written, if one is not drawn."""
    path = write_drawn(folder / PAGE, lambda: page_html("document.html", manifest=manifest, sections=sections,
                                                             inline=_inline), folder)
    failed = [f"{part.of.title} ({part.failure})" for part in sections if part.failure]
    if failed:
        raise LfsrError(f"{path} lacks {'; '.join(failed)}: the records are whole, mend the drawing and run it again "
                        "with --draw")
    return path


def print_pdf(page: Path) -> Path | None:
    """Print a page with a browser of the Chromium family, None where there is none; LfsrError if that fails."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        return None
    with atomic_path(page.with_name(PRINTED)) as temporary:
        try:
            subprocess.run([browser, *FLAGS, f"--print-to-pdf={temporary.resolve()}", page.resolve().as_uri()],
                           check=True, capture_output=True, timeout=SECONDS_TO_PRINT)
        except (OSError, subprocess.SubprocessError) as error:
            raise LfsrError(f"{browser} could not print {page} ({error}): print it by hand") from None
    return page.with_name(PRINTED)


def html(markdown: str) -> Markup:
    """Return our own Markdown as HTML: headings, tables, lists and paragraphs with code and bold words."""
    blocks = re.split(r"\n{2,}", re.sub(r"\n {2,}(?=\S)", " ", markdown.strip()))  # items go on in further lines
    return Markup("\n").join(part for block in blocks for part in _parts(block.splitlines()))


def _parts(lines: list[str]) -> Iterator[Markup]:
    while lines and lines[0].startswith("#"):
        yield Markup("<h4>{}</h4>").format(_inline(lines.pop(0).lstrip("# ")))
    table = [line for line in lines if line.startswith("|")]
    items = [line[2:] for line in lines if line.startswith("- ")]
    words = [line for line in lines if not line.startswith(("|", "- "))]
    if words:
        yield Markup("<p>{}</p>").format(_inline(" ".join(words)))
    if items:
        yield Markup("<ul>{}</ul>").format(Markup().join(Markup("<li>{}</li>").format(_inline(item)) for item in items))
    if table:
        yield _table([[cell.strip() for cell in line.strip().strip("|").split("|")] for line in table])


def _table(rows: list[list[str]]) -> Markup:
    left = [not rule.endswith(":") for rule in rows[1]]

    def line(cells: Sequence[str], tag: str) -> Markup:
        parts = (Markup(f'<{tag}{" class=l" if to_left else ""}>{{}}</{tag}>').format(_inline(cell))
                 for cell, to_left in zip(cells, left, strict=True))
        return Markup("<tr>") + Markup().join(parts) + Markup("</tr>\n")

    return Markup('<div class="scroll" tabindex="0"><table><thead>{}</thead><tbody>\n{}</tbody></table></div>').format(
        line(rows[0], "th"), Markup().join(line(row, "td") for row in rows[2:]))


def _inline(text: str) -> Markup:
    words = re.sub(r"\[([^]]+)\]\([^)]+\)", r"\1", str(escape(text)))
    words = re.sub(r"`([^`]+)`", r"<code>\1</code>", words)
    words = re.sub(r"\*\*([^*]+)\*\*", r"<b>\1</b>", words)
    return Markup(re.sub(r"\*(\w[^*<]*)\*", r"<i>\1</i>", words))  # escaped above


def _own_ids(image: Markup, start: str) -> Markup:
    """Return an SVG whose ids no other has; those that nothing points to go."""
    used = set(re.findall(r'(?:href="#|url\(#)([^")]+)', image))
    kept = re.sub(r' id="([^"]+)"', lambda match: f' id="{start}{match[1]}"' if match[1] in used else "", image)
    return type(image)(re.sub(r'(href="#|url\(#)', rf"\g<1>{start}", kept))
