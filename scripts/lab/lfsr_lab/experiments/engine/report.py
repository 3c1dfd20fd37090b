"""The one report writer: results as JSON, Markdown tables, HTML pages and figures.

A page is one file that loads nothing from elsewhere, light and dark.
"""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import atomic_path
from lfsr_core.base.progress import accept_all_letters
from lfsr_core.base.records import write_record

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

STOPPED, BAD_INPUT = 130, 2  # exit codes
UNKNOWN = "–"
RULES = {"l": "---", "r": "---:"}  # below the header, by a column's letter


def write_report(folder: Path, stem: str, results: Any, texts: Mapping[str, Callable[[], str]]) -> list[Path]:
    """Write ``results`` as STEM.json, then what people read, and return the paths; errors as of ``write_drawn``.

    Parameters
    ----------
    folder, stem : of the files
    results : a record; None where it is written already
    texts : functions that return the content, by the end of the file's name, such as ".md", ".html", ".svg"
    """
    file = folder / f"{stem}.json"
    if results is not None:
        write_record(file, results)
    return [file, *(write_drawn(folder / f"{stem}{end}", make, file) for end, make in texts.items())]


def write_drawn(path: Path, make: Callable[[], str], results: Path) -> Path:
    """Write the text that ``make`` draws of the file ``results``, and return ``path``; LfsrError if that fails."""
    try:
        return write_text(path, make())
    except LfsrError:
        raise
    except Exception as error:  # of a library
        raise LfsrError(f"{path} cannot be drawn ({error}): what was measured is in {results}") from error


def write_text(path: Path, text: str) -> Path:
    """Write text, whole or not at all, and return ``path``."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def page_html(template: str, **values: Any) -> str:
    """Return the page that ``template``, a file of templates/, makes of ``values``; text in them is escaped."""
    return _templates().get_template(template).render(values)


def inline_svg(svg: str, title: str) -> Markup:
    """Return an SVG document to stand in a page and scale with it; ``title`` is read aloud in its place."""
    from markupsafe import Markup

    return Markup('<svg role="img" aria-label="{}"').format(title) + Markup(svg[svg.index("<svg") + len("<svg"):])


@functools.cache
def _templates() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    return Environment(loader=PackageLoader("lfsr_lab.experiments.engine", "templates"), autoescape=True,
                       undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)


def markdown_table(header: Sequence[object], rows: Iterable[Sequence[object]], align: str = "") -> list[str]:
    """Return the lines of a Markdown table; cells that are not text are written by ``cell_text``.

    ``align`` has a letter per column, "l" or "r"; the last one stands for all further columns, "l" without any.
    """
    letters = align.ljust(len(header), align[-1:] or "l")
    return [_line(header), _line([RULES[letter] for letter in letters[:len(header)]]), *map(_line, rows)]


def cell_text(value: object) -> str:
    """Return a value as a table shows it: a dash for None, yes or no, three digits behind the point of a float."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return number(value) if value is None or isinstance(value, float) else str(value)


def number(value: float | None, half: float | None = None, digits: int = 3) -> str:
    """Return a number, with the half-width of its interval where it has one; a dash for None."""
    if value is None:
        return UNKNOWN
    return f"{value:.{digits}f}" + (f" ± {half:.{digits}f}" if half else "")


def _line(cells: Iterable[object]) -> str:
    return "| " + " | ".join(map(cell_text, cells)) + " |"


def exit_code(name: str, action: Callable[[], object]) -> int:
    """Run a study: 0, 2 with a sentence after bad input, 130 after Ctrl-C."""
    accept_all_letters()
    try:
        action()
    except LfsrError as error:
        print(f"{name}: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print(f"{name}: stopped; run the same command again to continue", file=sys.stderr)
        return STOPPED
    return 0
