"""Tasks of the add-on on frame folders; each returns JSON-ready data."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.files import atomic_path
from lfsr_core.base.notices import Progress
from lfsr_core.base.records import from_data
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.process.protocol import emit_told


def finish(folder: str, finish: dict[str, Any], views: str | None = None) -> dict[str, Any]:
    """Finish a rendered frame folder, and ``decode`` it into the file ``views``; return the "method" that ran."""
    from lfsr_core.pipeline.finishing import finish_frame

    report = finish_frame(folder, from_data(Finish, finish, "the finish"), emit_told)
    if views and not FrameFolder(folder).rendered.panel_rays:
        decode(folder, views)
    return {"method": report.method}


def decode(folder: str, views: str) -> dict[str, Any]:
    """Write the views of a finished folder as a .npy, uint8 (py, px, sy, sx, 3); return their "shape".

    Row 0 is the topmost camera. One view is contiguous: a reader that maps the file touches a few kB per view.
    """
    from lfsr_core.frames.views import read_views

    emit_told(Progress("views", 0.0, "decoding views"))
    decoded = read_views(folder)
    with atomic_path(views) as temporary, temporary.open("wb") as file:
        np.save(file, decoded)
    return {"shape": list(decoded.shape)}


def view(folder: str) -> dict[str, Any]:
    """Write the viewer of a finished frame folder; return its "path"."""
    from lfsr_core.exports.page import write_page

    return {"path": str(write_page([folder], tell=emit_told).path)}


def export(folder: str, name: str, target: str, type: str | None = None) -> dict[str, Any]:
    """Write a finished frame folder in format ``name`` into ``target``; return the "first" file and their "count"."""
    from lfsr_core.exports.formats import export as write
    from lfsr_core.exports.options import ExportOptions

    files = write(folder, name, target, ExportOptions(type=type, tell=emit_told))
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

    shown = show_now(path, SCREEN if full_screen else None, fps, emit_told)
    return {"sentence": shown.sentence, "page": shown.page and str(shown.page.absolute())}
