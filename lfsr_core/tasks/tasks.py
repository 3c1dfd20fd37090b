"""The add-on's tasks: each takes and returns JSON-ready data."""

from __future__ import annotations

import dataclasses
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.files import atomic_path
from lfsr_core.base.notices import Notice, Progress
from lfsr_core.base.records import from_data, to_data, write_record
from lfsr_core.exports.formats import export as export_frames
from lfsr_core.exports.options import FILM_RATE, FILMS, QUILT_FILM, ExportOptions, default_target
from lfsr_core.exports.page import write_page
from lfsr_core.exports.show import SCREEN, find_display
from lfsr_core.exports.show import show as show_path
from lfsr_core.frames.folder import FrameFolder, frame_folders
from lfsr_core.frames.frame import EIA_FILE, PANEL_FILE
from lfsr_core.frames.request import Finish, Request
from lfsr_core.frames.views import read_views
from lfsr_core.metrics.compare import compare_with_reference
from lfsr_core.pipeline.make import FAILED, finish_frame
from lfsr_core.pipeline.make import make as make_frames
from lfsr_core.plan.choose import first_guess
from lfsr_core.plan.options import PlanOptions
from lfsr_core.plan.planner import make_plan
from lfsr_core.process.child import Child
from lfsr_core.process.protocol import LAST_STAGES, emit_told, told_of
from lfsr_core.tasks.estimate import measure


@dataclasses.dataclass(frozen=True)
class RenderCommand:
    """Command of the add-on that starts Blender; a ``process.blender.Starts``."""

    words: tuple[str, ...]

    def command(self, *request_files: Path) -> list[str]:
        """Return the command line that renders ``request_files``."""
        return [*self.words, *map(str, request_files)]

    def run(self, *words: str) -> dict[str, Any]:
        """Run another job of Blender's, such as the encoding of a film; return what it answers."""
        with Child([*self.words, *words]) as child:
            for record in child.records():
                if record["stage"] not in LAST_STAGES and (told := told_of(record)) is not None:
                    emit_told(told)
            if not child.is_done():
                raise child.crash("Blender stopped with", "try again")
            return child.last


def make(request: dict[str, Any], finish: dict[str, Any], command: list[str], frames: list[int] | None = None,
         overwrite: bool = False, views: str | None = None) -> dict[str, Any]:
    """Make an image, or the ``frames`` of an animation that are not there; see ``pipeline.make``.

    ``command``: words that start a render, before the request files; ``views``: file for the decoded views of the last
    frame. Frames of other settings are rendered again, since the panel shows what is wanted. Returns {"made": data of
    each ``Made``}.
    """
    made = make_frames(from_data(Request, request, "the request"), from_data(Finish, finish, "the finish"), frames,
                       blender=RenderCommand(tuple(command)), overwrite=overwrite or frames is None, lenient=True,
                       tell=emit_told)
    if views and made[-1].state != FAILED and not FrameFolder(made[-1].folder).rendered.subpixels:
        decode(made[-1].folder, views)
    return {"made": [to_data(result) for result in made]}


def reference(request: dict[str, Any], output: str, lenses: int, samples: int, command: list[str]) -> dict[str, Any]:
    """Render the reference of the finished frame of a request, see ``metrics.compare.compare_with_reference``.

    Returns the "metrics" of the frame's report.
    """
    wanted = from_data(Request, request, "the request")
    compare_with_reference(wanted, wanted.output, output, lenses, samples, RenderCommand(tuple(command)), emit_told)
    return {"metrics": FrameFolder(wanted.output).report.metrics}


def estimate(request: dict[str, Any], command: list[str]) -> dict[str, Any]:
    """Measure how fast the scene of a request renders, from a few lenses; return data of a ``Measured``."""
    measured = measure(from_data(Request, request, "the request"), RenderCommand(tuple(command)), emit_told)
    return dataclasses.asdict(measured)


def plan(request: dict[str, Any], options: dict[str, Any], command: list[str]) -> dict[str, Any]:
    """Plan for the scene of a request, with ``PlanOptions``; return data of a ``plan.choose.Choice``.

    ``command``: words that start a render, before the request files. A first guess, from the depth of the scene, is
    told before anything is measured, by the notice "first-guess".
    """
    wanted, blender = from_data(PlanOptions, options, "options of the plan"), RenderCommand(tuple(command))
    asked = from_data(Request, request, "the request")
    with tempfile.TemporaryDirectory() as work:
        file = Path(work, "request.json")
        write_record(file, asked)
        moves = np.array(blender.run("depth", str(file))["moves"])
        emit_told(Notice("first-guess", to_data(first_guess(asked.display, moves, wanted))))
        choice = make_plan(asked, wanted, lambda one, tell: make_frames(one, blender=blender, tell=tell), work,
                           emit_told).choice
    found: dict[str, Any] = to_data(choice)
    return found


def finish(folder: str, finish: dict[str, Any], views: str | None = None) -> dict[str, Any]:
    """Finish a rendered frame folder, and ``decode`` it into the file ``views``; return the "method" that ran."""
    report = finish_frame(folder, from_data(Finish, finish, "the finish"), emit_told)
    if views and not FrameFolder(folder).rendered.subpixels:
        decode(folder, views)
    return {"method": report.method}


def decode(folder: str, views: str) -> dict[str, Any]:
    """Write the views of a finished folder as a .npy, uint8 (py, px, sy, sx, 3); return their "shape".

    Row 0 is the topmost camera. One view is contiguous: a reader that maps the file touches a few kB per view.
    """
    emit_told(Progress("views", 0.0, "decoding views"))
    decoded = read_views(folder)
    with atomic_path(views) as temporary, temporary.open("wb") as file:
        np.save(file, decoded)
    return {"shape": list(decoded.shape)}


def view(folder: str) -> dict[str, Any]:
    """Write the viewer of a finished frame folder; return its "path"."""
    return {"path": str(write_page([folder], tell=emit_told).path)}


def export(folder: str, name: str, target: str, fps: float | None, command: list[str]) -> dict[str, Any]:
    """Write a finished frame folder in format ``name`` into ``target``; return the "first" file.

    Of films Blender encodes the frames, ``fps`` a second or as usual: this Python has no encoder. ``command``: words
    that start it.
    """
    is_film = name in (*FILMS, QUILT_FILM)
    with tempfile.TemporaryDirectory() as frames:
        options = ExportOptions(type="png" if is_film else None, tell=emit_told)
        files = export_frames(folder, name, frames if is_film else target, options)
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
    frames = frame_folders(Path(path), (EIA_FILE, PANEL_FILE))
    if len(frames) > 1 and not full_screen and find_display(frames[0]) is not None:
        path = export(path, QUILT_FILM, str(default_target(path, QUILT_FILM)), fps, command)["first"]
    shown = show_path(path, SCREEN if full_screen else None, fps, emit_told)
    return {"sentence": shown.sentence, "page": shown.page and str(shown.page.absolute())}
