"""HTML pages of measurements: one file each that loads nothing from elsewhere, light and dark."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lfsr_core.files import atomic_path

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup


def page_html(template: str, **values: Any) -> str:
    """The page that ``template``, a file of templates/, makes of ``values``; text in them is escaped.

    Every template extends base.html and may import the tables of macros.html.
    """
    return _templates().get_template(template).render(values)


def write_page(path: Path, template: str, **values: Any) -> Path:
    """Write ``page_html`` to ``path``, whole or not at all; returns ``path``."""
    return write_text(path, page_html(template, **values))


def write_text(path: Path, text: str) -> Path:
    """Write text, whole or not at all; returns ``path``."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def inline_svg(svg: str, title: str) -> Markup:
    """An SVG document to stand in a page as it is and scale with it; ``title`` is what it shows, for who cannot see."""
    from markupsafe import Markup

    return Markup('<svg role="img" aria-label="{}"').format(title) + Markup(svg[svg.index("<svg") + len("<svg"):])


@functools.cache
def _templates() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    return Environment(loader=PackageLoader("lfsr_lab.experiments", "templates"), autoescape=True,
                       undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
