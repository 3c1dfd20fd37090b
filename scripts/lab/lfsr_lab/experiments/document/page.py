"""The report: every study's figures with their commands, tables, and the manifest, as one HTML file and a PDF."""

from __future__ import annotations

import dataclasses
import re
import shutil
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup, escape

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import atomic_path
from lfsr_lab.experiments.document.figures import Shown, shown
from lfsr_lab.experiments.document.studies import Kept, Study
from lfsr_lab.experiments.engine.report import page_html, write_drawn

PAGE, PRINTED = "report.html", "report.pdf"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome", "msedge")
FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer")  # no sandbox: it may run as root
SECONDS_TO_PRINT = 180


@dataclasses.dataclass(frozen=True)
class Section:
    id: str
    study: Study
    of: Kept
    found: Shown
    failure: str = ""  # why it could not be drawn


def section(study: Study, kept: Kept, record: Path, images: Path) -> Section:
    """Draw one record; what cannot be drawn says so in its place, so that the others are shown."""
    name = re.sub(r"\W+", "-", kept.file).strip("-")
    try:
        found = shown(kept.kind or study.kind, record, images)
        figures = [dataclasses.replace(figure, image=_own_ids(figure.image, f"{name}-{number}-"))
                   for number, figure in enumerate(found.figures)]
        found = dataclasses.replace(found, figures=figures, tables=html(found.tables), lead=html(found.lead))
        return Section(name, study, kept, found)
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
    kept = re.sub(r' id="([^"]+)"', lambda found: f' id="{start}{found[1]}"' if found[1] in used else "", image)
    return type(image)(re.sub(r'(href="#|url\(#)', rf"\g<1>{start}", kept))
