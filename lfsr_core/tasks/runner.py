"""The add-on's tasks, each run in a process of its own.

    python -m lfsr_core.tasks.runner TASK.json

Progress and the result are ``LFSR {json}`` lines on standard output; the last one has the stage "done" or "error".
The process ends when its standard input does, so that it does not outlive Blender.
"""

import dataclasses
import math
import os
import shutil
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.messages import LfsrError, Notice, Progress
from lfsr_core.base.records import from_data, to_data
from lfsr_core.base.system import atomic_path, read_json, system_errors, watch_memory
from lfsr_core.exports.formats import export as export_frames
from lfsr_core.exports.light_field import read_views
from lfsr_core.exports.options import FILM_RATE, FILMS, QUILT_FILM, ExportOptions, default_target
from lfsr_core.exports.page import write_page
from lfsr_core.exports.show import SCREEN, find_display
from lfsr_core.exports.show import show as show_path
from lfsr_core.frames.folder import FrameFolder, frame_folders
from lfsr_core.frames.frame import EIA_FILE, LAYOUTS, PANEL_FILE, SUBPIXELS, Finish, Request, read_part
from lfsr_core.metrics.eia_metrics import compare_with_reference
from lfsr_core.pipeline.make import FAILED, open_blender
from lfsr_core.pipeline.make import make as make_frames
from lfsr_core.plan.options import Measured, PlanOptions, path_samples, render_seconds
from lfsr_core.plan.planner import LEAST_SIDE, make_plan
from lfsr_core.process import child as protocol
from lfsr_core.process.child import Child
from lfsr_core.reconstruct.second_stage import finish_frame

SECONDS_TO_STOP = 1.0  # less than the add-on waits for the task itself
PATHS = 600_000  # path samples to measure: a second or two
SAMPLES = 16  # at most, so that many lenses are seen
SOME = 4  # the smaller render has one lens in SOME


@dataclasses.dataclass(frozen=True)
class RenderCommand:
    """Command of the add-on that starts Blender; a ``process.child.Starts``."""

    words: tuple[str, ...]

    def command(self, *request_files: Path | str) -> list[str]:
        """Return the command line that renders ``request_files``."""
        return [*self.words, *map(str, request_files)]

    def run(self, *words: str) -> dict[str, Any]:
        """Have Blender do other work, such as to encode a film; return its last record."""
        with Child([*self.words, *words]) as child:
            for record in child.records():
                if record["stage"] not in protocol.LAST_STAGES and (told := protocol.told_of(record)) is not None:
                    protocol.emit_told(told)
            if not child.is_done():
                raise child.crash("Blender stopped with", "try again")
            return child.last


def make(request: dict[str, Any], finish: dict[str, Any], command: list[str], frames: list[int] | None = None,
         overwrite: bool = False, views: str | None = None) -> dict[str, Any]:
    """Make an image, or the ``frames`` of an animation that are not there; see ``pipeline.make``.

    ``command``: words that start a render, before the request files; ``views``: file for the decoded views of the last
    frame. Frames of other settings are rendered again, because the panel's settings decide. Returns {"made": data of
    each ``Made``}.
    """
    made = make_frames(from_data(Request, request, "the request"), from_data(Finish, finish, "the finish"), frames,
                       blender=RenderCommand(tuple(command)), overwrite=overwrite or frames is None, lenient=True,
                       tell=protocol.emit_told)
    if views and made[-1].state != FAILED and not FrameFolder(made[-1].folder).rendered.subpixels:
        decode(made[-1].folder, views)
    return {"made": [to_data(result) for result in made]}


def reference(request: dict[str, Any], output: str, lenses: int, samples: int, command: list[str]) -> dict[str, Any]:
    """Render the reference of the finished frame of a request, see ``metrics.eia_metrics.compare_with_reference``.

    Returns the "metrics" of the frame's report.
    """
    wanted = from_data(Request, request, "the request")
    compare_with_reference(wanted, wanted.output, output, lenses, samples, RenderCommand(tuple(command)),
                           protocol.emit_told)
    return {"metrics": FrameFolder(wanted.output).report.metrics}


def estimate(request: dict[str, Any], command: list[str]) -> dict[str, Any]:
    """Measure how fast the scene of a request renders, from a few lenses; return data of a ``Measured``.

    Three renders: one lens or a few, which prepare the scene, then some lenses, then many. The last two differ by the
    time of their samples alone, because Cycles prepares some things again for each list of lenses. Subpixels of a panel
    are estimated from lenses too, because their paths cost as much.
    """
    asked, started = from_data(Request, request, "the request"), time.monotonic()
    asked = dataclasses.replace(asked, layout=LAYOUTS[0] if asked.layout == SUBPIXELS else asked.layout)
    asked, many = asked.sampled(rays=None, samples=samples_of(asked)), lenses_of(asked)
    few = max(math.ceil(LEAST_SIDE / views) for views in asked.display.low_views(asked.sampling.scale)) ** 2
    step = max(1, min(SOME, len(many) // few))

    def heard(told: Progress | Notice) -> None:
        if isinstance(told, Progress) and told.stage == "render":
            told = dataclasses.replace(told, stage="estimate")
        protocol.emit_told(told)

    with tempfile.TemporaryDirectory() as folder:
        requests = [dataclasses.replace(asked, output=str(Path(folder, str(number))), lens_list=tuple(lenses))
                    for number, lenses in enumerate((many[:few], many[::step], many))]
        make_frames(requests, blender=RenderCommand(tuple(command)), tell=heard)
        _, some, whole = (read_part(one.output) for one in requests)
    sampling, more = (cost(whole) - cost(some) for cost in (render_seconds, path_samples))
    # The image needs all the rest once too.
    fixed = max(time.monotonic() - started - some.seconds["render"] - whole.seconds["render"], 0.0)
    # With a single lens, or if other work slowed the shorter render, all of the longer one counts as sampling.
    per_path = sampling / more if more and sampling > 0 else render_seconds(whole) / path_samples(whole)
    return dataclasses.asdict(Measured(fixed, per_path, whole.scale))


def plan(request: dict[str, Any], options: dict[str, Any], command: list[str]) -> dict[str, Any]:
    """Plan for the scene of a request, with ``PlanOptions``; return data of a ``plan.options.Choice``.

    ``command``: words that start a render, before the request files.
    """
    wanted = from_data(PlanOptions, options, "options of the plan")
    with tempfile.TemporaryDirectory() as work, open_blender(RenderCommand(tuple(command)), Path(work)) as render:
        planned = make_plan(from_data(Request, request, "the request"), wanted, render, work, protocol.emit_told)
    return dict(to_data(planned.choice))


def finish(folder: str, finish: dict[str, Any], views: str | None = None) -> dict[str, Any]:
    """Finish a rendered frame folder, and ``decode`` it into the file ``views``; return the "method" that ran."""
    report = finish_frame(folder, from_data(Finish, finish, "the finish"), protocol.emit_told)
    if views and not FrameFolder(folder).rendered.subpixels:
        decode(folder, views)
    return {"method": report.method}


def decode(folder: str, views: str) -> dict[str, Any]:
    """Write the views of a finished folder as a .npy, uint8 (py, px, sy, sx, 3); return their "shape".

    Row 0 is the topmost camera. One view is contiguous: a reader that maps the file touches a few kB per view.
    """
    protocol.emit_told(Progress("views", 0.0, "decoding views"))
    decoded = read_views(folder)
    with atomic_path(views) as temporary, temporary.open("wb") as file:
        np.save(file, decoded)
    return {"shape": list(decoded.shape)}


def view(folder: str) -> dict[str, Any]:
    """Write the viewer of a finished frame folder; return its "path"."""
    return {"path": str(write_page([folder], tell=protocol.emit_told).path)}


def export(folder: str, name: str, target: str, fps: float | None, command: list[str]) -> dict[str, Any]:
    """Write a finished frame folder in format ``name`` into ``target``; return the "first" file.

    Blender encodes the frames of a film, with ``fps`` or the usual rate, because this Python has no encoder.
    ``command``: words that start Blender.
    """
    is_film = name in (*FILMS, QUILT_FILM)
    with tempfile.TemporaryDirectory() as frames:
        options = ExportOptions(type="png" if is_film else None, tell=protocol.emit_told)
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
    shown = show_path(path, SCREEN if full_screen else None, fps, protocol.emit_told)
    return {"sentence": shown.sentence, "page": shown.page and str(shown.page.absolute())}


def lenses_of(request: Request) -> list[tuple[int, int]]:
    """Lenses (row, column) spread evenly over the display, enough for PATHS path samples."""
    columns, rows = request.display.lenses
    views = request.display.low_views(request.sampling.scale)
    count = min(max(PATHS // (views[0] * views[1] * samples_of(request)), 1), rows * columns)
    across = min(columns, max(1, round((count * columns / rows) ** 0.5)))
    down = min(rows, max(1, round(count / across)))
    places = [((np.arange(number) + 0.5) / number * total).astype(int)
              for number, total in ((down, rows), (across, columns))]
    return [(int(row), int(column)) for row in places[0] for column in places[1]]


def samples_of(request: Request) -> int:
    """Samples per pixel: as many as the image's, so that Cycles works as for it, and more where it has few pixels."""
    rendered = math.prod(request.display.eia_pixels) // request.display.finished_pixels(request.sampling.scale)
    return max(min(SAMPLES, request.sampling.samples), PATHS // rendered)


# A task takes the entries of its file and returns JSON-ready data. Some start processes.
Task = Callable[..., dict[str, Any]]
STARTING: dict[str, Task] = {task.__name__: task for task in (make, reference, estimate, plan, export, show)}
TASKS: dict[str, Task] = STARTING | {task.__name__: task for task in (finish, decode, view)}


def main(arguments: list[str]) -> int:
    """Run the task file named in ``arguments``; return the exit code."""
    try:
        data = read_json(arguments[0], "a task of the add-on")
        name = data.pop("task")
        _end_on_request(unwinds=name in STARTING)
        watch_memory(_fail)
        with system_errors(), protocol.repeated():
            result = TASKS[name](**data)
    except LfsrError as error:
        protocol.emit(stage="error", message=str(error))
        return protocol.EXIT_BAD_INPUT
    except KeyboardInterrupt:
        return protocol.EXIT_CANCELLED
    protocol.emit(stage="done", **result)
    return 0


def _end_on_request(unwinds: bool) -> None:
    """End at a signal, and at the end of standard input, which comes with the end of Blender.

    ``unwinds``: by an exception, so that processes of the task are stopped too; otherwise at once.
    """
    def end_with_parent() -> None:
        # Not sys.stdin: a thread that holds its lock aborts Python at exit.
        while os.read(0, 1):
            pass
        if unwinds:
            protocol.interrupt_main(signal.SIGTERM)
            Child.stop_all(SECONDS_TO_STOP)  # the main thread waits for what they write
        else:
            _leave()

    signal.signal(signal.SIGTERM, signal.default_int_handler if unwinds else _leave)
    threading.Thread(target=end_with_parent, daemon=True, name="lfsr-parent").start()


def _fail(sentence: str) -> None:
    protocol.emit_last(stage="error", message=sentence)
    Child.stop_all(SECONDS_TO_STOP)
    os._exit(protocol.EXIT_BAD_INPUT)


def _leave(*_: object) -> None:
    # Temporary files lie in the add-on's staging folder, which is removed.
    os._exit(protocol.EXIT_CANCELLED)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
