"""Tasks of the add-on on frame folders; each returns JSON-ready data."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.files import atomic_path
from lfsr_core.base.notices import Progress
from lfsr_core.base.records import from_data
from lfsr_core.exports.options import FILM_RATE, FILMS, QUILT_FILM, default_target
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.folder import FrameFolder, frame_folders
from lfsr_core.frames.frame import EIA_FILE, PANEL_FILE
from lfsr_core.process.protocol import emit_told
from lfsr_core.tasks.command import RenderCommand


def finish(folder: str, finish: dict[str, Any], views: str | None = None) -> dict[str, Any]:
    """Finish a rendered frame folder, and ``decode`` it into the file ``views``; return the "method" that ran."""
    from lfsr_core.pipeline.make import finish_frame

    report = finish_frame(folder, from_data(Finish, finish, "the finish"), emit_told)
    if views and not FrameFolder(folder).rendered.subpixels:
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


def export(folder: str, name: str, target: str, fps: float | None, command: list[str]) -> dict[str, Any]:
    """Write a finished frame folder in format ``name`` into ``target``; return the "first" file.

    Of films Blender encodes the frames, ``fps`` a second or as usual: this Python has no encoder. ``command``: words
    that start it.
    """
    from lfsr_core.exports.formats import export as write
    from lfsr_core.exports.options import ExportOptions

    is_film = name in (*FILMS, QUILT_FILM)
    with tempfile.TemporaryDirectory() as frames:
        options = ExportOptions(type="png" if is_film else None, tell=emit_told)
        files = write(folder, name, frames if is_film else target, options)
        if not is_film:
            return {"first": str(files[0])}
        film = Path(frames, f"{files[0].stem.rpartition('_')[0]}.mp4")
        RenderCommand(tuple(command)).run("encode", frames, str(film), str(fps or FILM_RATE))
        Path(target).mkdir(parents=True, exist_ok=True)
        with atomic_path(Path(target, film.name)) as temporary:
            shutil.copyfile(film, temporary)
    return {"first": str(Path(target, film.name))}


def show(path: str, full_screen: bool, fps: float, command: list[str]) -> dict[str, Any]:
    """Show a frame folder or all frames in a folder; return the "sentence" and the "page" to open, or None.

    ``full_screen``: the panel's own image, also where views could go through Looking Glass Bridge; ``fps`` and
    ``command`` as of ``export``.
    """
    from lfsr_core.exports.show import SCREEN, find_display
    from lfsr_core.exports.show import show as show_now

    frames = frame_folders(Path(path), (EIA_FILE, PANEL_FILE))
    if len(frames) > 1 and not full_screen and find_display(frames[0]) is not None:
        path = export(path, QUILT_FILM, str(default_target(path, QUILT_FILM)), fps, command)["first"]
    shown = show_now(path, SCREEN if full_screen else None, fps, emit_told)
    return {"sentence": shown.sentence, "page": shown.page and str(shown.page.absolute())}
