"""Tasks of the add-on on one frame folder; each returns JSON-ready data."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.files import atomic_path
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.frame import MASK_FILE, read_frame
from lfsr_core.process.protocol import emit_progress, emit_told, emit_warning


def upscale(folder: str, method: str, linear_exr: bool = False, views: str | None = None) -> dict[str, Any]:
    """Finish a rendered frame folder, and ``decode`` it into the file ``views``.

    Return the "method" and the "seconds" of each stage.
    """
    from lfsr_core.pipeline.finishing import finish_frame

    report = finish_frame(folder, Finish(method, linear_exr=linear_exr), emit_told)
    if views:
        decode(folder, views)
    return {"method": report.method, "seconds": report.seconds}


def decode(folder: str, views: str) -> dict[str, Any]:
    """Write the views of a finished folder as a .npy, uint8 (py, px, sy, sx, 3); return their "shape".

    Row 0 is the topmost camera. One view is contiguous: a reader that maps the file touches a few kB per view.
    """
    from lfsr_core.frames.views import read_views

    emit_progress("preview", 0.0, "decoding views")
    decoded = read_views(folder)
    with atomic_path(views) as temporary, temporary.open("wb") as file:
        np.save(file, decoded)
    return {"shape": list(decoded.shape)}


def choose(folder: str, count: int, seed: int = 0) -> dict[str, Any]:
    """Choose lenses of a finished folder to compare: a "lens_list" of (row, column), None for all lenses.

    ``count`` is their number; 0 and more than there are mean all.
    """
    from lfsr_core.images.png import read_mask
    from lfsr_core.optics.lens_sampling import choose_lenses

    mask = read_mask(Path(folder, MASK_FILE), read_frame(folder).display.lenses)
    every = count < 1 or count >= mask.size
    return {"lens_list": None if every else [list(lens) for lens in choose_lenses(mask, count, seed)]}


def compare(folder: str, reference: str) -> dict[str, Any]:
    """Compare a finished folder with a reference folder; return the "metrics" of its report."""
    from lfsr_core.frames.report import read_report
    from lfsr_core.metrics.compare import compare_folders

    emit_progress("compare", 0.0, "comparing")
    compare_folders(folder, reference)
    return {"metrics": read_report(folder).metrics}


def view(folder: str) -> dict[str, Any]:
    """Write the viewer of a finished frame folder; return its "path"."""
    from lfsr_core.exports.page import write_page

    page = write_page([folder], progress=emit_progress)
    _warn(page.notes)
    return {"path": str(page.path)}


def export(folder: str, name: str, target: str, type: str | None = None) -> dict[str, Any]:
    """Write a finished frame folder in format ``name`` into ``target``; return the "first" file and their "count"."""
    from lfsr_core.exports.formats import export as write
    from lfsr_core.exports.options import ExportOptions

    files, notes = write(folder, name, target, ExportOptions(type=type, progress=emit_progress))
    _warn(notes)
    return {"first": str(files[0]), "count": len(files)}


def find_display(folder: str) -> dict[str, Any]:
    """Say whether a frame is shown through Looking Glass Bridge, in "through_bridge"; errors as of ``show``."""
    from lfsr_core.exports.show import find_display

    return {"through_bridge": find_display(Path(folder)) is not None}


def show(path: str, full_screen: bool, fps: float) -> dict[str, Any]:
    """Show a frame folder, a folder of them or a quilt; return the "sentence" and the "page" to open, or None.

    ``full_screen``: the panel's own image, also where views could go through Looking Glass Bridge.
    """
    from lfsr_core.exports.show import SCREEN
    from lfsr_core.exports.show import show as show_now

    shown = show_now(path, SCREEN if full_screen else None, fps, emit_progress)
    return {"sentence": shown.sentence, "page": shown.page and str(shown.page.absolute())}


def _warn(notes: Iterable[str]) -> None:
    for note in notes:
        emit_warning(note)
