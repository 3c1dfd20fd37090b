"""The one report writer: results as JSON, Markdown tables, HTML pages and figures.

A page is one file that loads nothing from elsewhere, light and dark.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import importlib.util
import os
import platform
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from lfsr_core import __version__
from lfsr_core.base.messages import LfsrError
from lfsr_core.base.records import write_record
from lfsr_core.base.system import atomic_path

if TYPE_CHECKING:
    import jinja2

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
    return Markup('<svg role="img" aria-label="{}"').format(title) + Markup(svg[svg.index("<svg") + len("<svg"):])


@functools.cache
def _templates() -> jinja2.Environment:
    from jinja2 import Environment as Templates
    from jinja2 import PackageLoader, StrictUndefined

    return Templates(loader=PackageLoader("lfsr_lab.experiments.engine", "templates"), autoescape=True,
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


PACKAGES = ("bpy", "numpy", "pyoidn", "torch", "OpenImageIO", "opencolorio")
REPORT_PACKAGES = ("Jinja2", "matplotlib")  # of the package lfsr-lab


@dataclasses.dataclass(frozen=True)
class Environment:
    """Machine and versions that figures were measured with; every report has it."""

    cpu: str  # name of the processor
    cores: int  # number of its logical cores
    memory_gib: float | None  # main memory, None where it is not known
    system: str  # operating system
    python: str  # version of Python
    gpu: str | None  # name of the graphics card that PyTorch used, None without one
    versions: dict[str, str]  # of LFSR and of each package that is installed, by name

    @property
    def machine(self) -> str:
        """Processor and graphics card in words."""
        return f"{self.cores} cores of {self.cpu}" + (f" and {self.gpu}" if self.gpu else "")

    @property
    def packages(self) -> str:
        return ", ".join(f"{name} {number}" for name, number in self.versions.items())


def environment() -> Environment:
    """Return the environment of this process; a graphics card is named only once PyTorch is loaded."""
    versions, memory = {"lfsr": __version__}, None
    for name in PACKAGES:
        with contextlib.suppress(PackageNotFoundError):
            versions[name] = version(name)
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        named = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
        cpu = next(named, platform.machine())
    except OSError:
        cpu = platform.processor() or platform.machine()
    if sys.platform != "win32":
        with contextlib.suppress(ValueError, OSError):
            memory = round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1)
    torch = sys.modules.get("torch")  # not imported only to ask: without it no method used a GPU
    gpu = torch.cuda.get_device_name() if torch is not None and torch.cuda.is_available() else None
    return Environment(cpu, os.cpu_count() or 1, memory, platform.system(), platform.python_version(), gpu, versions)


def check_packages() -> None:
    """LfsrError if a package that writes the reports is not installed: before hours of measuring, not after them."""
    for package in REPORT_PACKAGES:
        if importlib.util.find_spec(package.lower()) is None:
            raise LfsrError(f"reports need the Python package {package!r}, which is not installed: install lfsr-lab")


def load_average() -> float | None:
    """Return the load average of the last minute, None where it is not known."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else None

