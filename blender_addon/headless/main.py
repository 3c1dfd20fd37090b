"""Run requests inside Blender, renders or the encoding of a film, with their progress on standard output."""

import contextlib
import dataclasses
import os
import queue
import shutil
import threading
import time
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NoReturn

import bpy

from lfsr_core.base.messages import LfsrError, Notice, Progress, Tell
from lfsr_core.base.records import to_data
from lfsr_core.base.system import file_stamp, system_errors, watch_memory
from lfsr_core.exports.options import H264_SIDE
from lfsr_core.frames.folder import PLACES, digest, request_facts, scene_stamp
from lfsr_core.frames.frame import Request, read_request
from lfsr_core.optics.depth_scale import ScaleChoice
from lfsr_core.pipeline.parts import remove_others
from lfsr_core.process import child as protocol

from ..compat import assign, literal_path, new_data, overridden, video_output
from ..render.frame_folder import Opened, inputs_before_opening, render_job, settled_light
from ..render.output import UNFINISHED
from ..scene.array import placement
from ..scene.contents import left_out
from ..scene.files import camera_notices, check_files, choose_camera, choose_scene, open_scene, paint_missing, shown
from ..scene.light import lit

MOST_WAITING, LEAST_WORK = 60, 0.05  # seconds with fewer CPU seconds than that, after which a file does not answer


def main(arguments: Sequence[str]) -> int:
    """Run the request files named in ``arguments``, ``stay``, ``encode FRAMES FILE RATE``, or ``scale`` and a request.

    Returns the exit code. ``stay``: request files come on standard input, one a line, until that ends.
    """
    asked = queue.SimpleQueue[str]()
    if os.environ.get(protocol.ENDS_WITH_INPUT):
        threading.Thread(target=_end_with_input, args=(asked,), daemon=True, name="lfsr-stop").start()
    watch_memory(lambda sentence: _end("error", sentence, protocol.EXIT_BAD_INPUT))
    try:
        with system_errors(), protocol.repeated():
            match arguments:
                case ["encode", frames, film, rate]:
                    result: dict[str, object] = {"folder": str(encode(frames, film, rate))}
                case ["scale", path]:
                    request = read_request(path)
                    result = to_data(placement.scale_of(_chosen_scene(request), request))
                case [word] if word == protocol.STAY:
                    result = {"folder": str(run_all(map(read_request, iter(asked.get, None))))}
                case [] | ["encode" | "scale", *_]:
                    raise LfsrError("expected request files, stay, encode with two paths and a rate, or scale with a "
                                    f"request file, but got {len(arguments)} arguments")
                case _:
                    result = {"folder": str(run_all(map(read_request, arguments)))}
    except LfsrError as error:
        protocol.emit(stage="error", message=str(error))
        return protocol.EXIT_BAD_INPUT
    protocol.emit(stage="done", **result)
    return 0


def _end_with_input(asked: queue.SimpleQueue[str]) -> None:
    """Put lines of standard input into ``asked``, and end the process at its end.

    The process that started this one holds the other end of the pipe: it closes it to stop the render, and the system
    does when it dies. Cycles does not return to Python before its image is done, so that a thread waits for it.
    """
    rest = b""
    while some := os.read(0, 4096):
        *lines, rest = (rest + some).split(b"\n")
        for line in lines:
            asked.put(line.decode())
    _end("cancelled", "stopped", protocol.EXIT_CANCELLED)


def _end(stage: str, message: str, code: int) -> NoReturn:
    """Remove unfinished files and end the process, whatever Blender does in other threads."""
    for path in list(UNFINISHED):
        with contextlib.suppress(OSError):  # Windows removes no open file: the next run does
            shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)
    shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
    try:
        protocol.emit_last(stage=stage, message=message)
    finally:  # also if writing fails because nobody listens any more
        os._exit(code)


def answered(scene: str) -> contextlib.AbstractContextManager[None]:
    """End the process if the block waits endlessly for a file.

    Blender opens the libraries of a scene before anyone can look at their names, and a drive may not answer.
    """
    def watch(ended: threading.Event) -> None:
        quiet, worked = 0, time.process_time()
        while not ended.wait(1):
            quiet = quiet + 1 if time.process_time() - worked < LEAST_WORK else 0
            worked = worked if quiet else time.process_time()
            if quiet >= MOST_WAITING:
                _end("error", f"scene {scene} waits for a file that does not answer, such as a library that is a pipe, "
                     "or a drive: check what the scene links", protocol.EXIT_BAD_INPUT)

    return protocol.beside(watch, "lfsr-answered")


def run_all(requests: Iterable[Request]) -> Path:
    """Render ``requests``, opening a scene where it differs from the one before; return the last frame folder."""
    scene, opened, last, folder, choices = None, Opened(), None, Path(), dict[str, ScaleChoice]()
    with ExitStack() as stack:
        for request in requests:
            if last != (last := (request.scene, request.scene_name, request.light, request.camera)):
                stack.close()
                scene, opened = _opened(request, stack)
                placement.fields = {}  # a cache, since nobody edits this scene
                stack.callback(setattr, placement, "fields", None)
                stack.enter_context(lit(scene, opened.light))
                opened = dataclasses.replace(opened, kept=stack.enter_context(new_data()))
            if request.sampling.scales and request.sampling.frames:  # one scale for all frames that ask the same
                if (question := digest(request_facts(request, (*PLACES, "frame", "seed")))) not in choices:
                    choices[question] = placement.scale_of(scene, request)
                request = request.with_scale(choices[question])
            try:
                folder = render_job(scene, request, opened, protocol.emit_told)
                protocol.emit(stage=protocol.RENDERED_STAGE, folder=str(folder))
            except LfsrError as error:
                if request.frame is None:
                    raise
                protocol.emit(stage=protocol.FAILED_STAGE, message=str(error))  # other frames may be rendered
            opened = dataclasses.replace(opened, seconds=0.0)
    return folder


def _opened(request: Request, stack: ExitStack) -> tuple[bpy.types.Scene, Opened]:
    """The request's scene, as of ``_chosen_scene``, ready for Cycles until ``stack`` closes, and how it was opened."""
    started, path, content, notes = time.perf_counter(), Path(request.scene), "", list[Notice]()

    def say(told: Progress | Notice) -> None:
        if isinstance(told, Notice):
            notes.append(told)
        protocol.emit_told(told)

    before = file_stamp(path)
    if request.parts and path.is_file():
        content = scene_stamp(path)
        if other := remove_others(Path(request.parts), inputs_before_opening(request, content)):
            protocol.emit_told(Notice("parts-removed", {"input": other}))
    protocol.emit_told(Progress("open", detail=request.scene or "the open scene"))
    scene = _chosen_scene(request, say)
    if file_stamp(path) != before:
        content = ""
    seconds, is_imported = time.perf_counter() - started, path.suffix.lower() not in ("", ".blend")
    with answered(request.scene):
        check_files(scene, request.frame, request.allow_missing, say)
    if request.allow_missing:
        paint_missing()
    for notice in (*left_out(scene), *camera_notices(scene, request.camera, is_imported)):
        say(notice)
    # Else Cycles would build the scene again for each render: a change of the engine drops persistent data.
    stack.enter_context(overridden(scene.render, {"use_persistent_data": True, "engine": "CYCLES"}))
    return scene, Opened(seconds, content, settled_light(scene, request, say), tuple(notes))


def _chosen_scene(request: Request, say: Tell = protocol.emit_told) -> bpy.types.Scene:
    """The request's scene, opened if it names a file, with its camera chosen."""
    with answered(request.scene):
        scene = open_scene(request.scene, say) if request.scene else bpy.context.scene
    if request.scene_name is not None:
        scene = choose_scene(request.scene_name)
    if scene.library is not None:  # so that a camera can be added; its objects stay linked
        scene = shown(scene.make_local())
    if request.camera is not None:
        choose_camera(scene, request.camera)
    return scene


def encode(frames_folder: str, film_file: str, frames_a_second: str) -> Path:
    """Encode the PNG images of a folder as MP4 and return the film; LfsrError if this Blender cannot."""
    folder, film, rate = Path(frames_folder), Path(film_file), float(frames_a_second)
    if not (frames := sorted(folder.glob("*.png"))):
        raise LfsrError(f"{folder} has no PNG frames to encode: export again")
    if not bpy.app.ffmpeg.supported:
        raise LfsrError("this Blender was built without FFmpeg and cannot write MP4: choose another format")
    # A scene with nothing but the frames, in their own colours.
    scene = bpy.data.scenes.new("Film")
    strip = scene.sequence_editor_create().strips.new_image("Frames", str(frames[0]), channel=1, frame_start=1)
    for frame in frames[1:]:
        strip.elements.append(frame.name)
    strip.frame_final_duration = len(frames)  # for the appended elements to count
    scene.frame_start, scene.frame_end = 1, len(frames)
    scene.display_settings.display_device, scene.view_settings.view_transform = "sRGB", "Standard"
    render, size = scene.render, (strip.elements[0].orig_width, strip.elements[0].orig_height)
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 100
    render.fps, render.fps_base = round(rate), round(rate) / rate
    assign(render.image_settings, video_output())
    video, codec = render.ffmpeg, "H264" if max(size) <= H264_SIDE else "H265"
    video.format, video.codec, video.constant_rate_factor, video.gopsize = "MPEG4", codec, "PERC_LOSSLESS", 30
    render.use_file_extension, render.filepath = False, literal_path(str(film))
    bpy.app.handlers.render_write.append(
        lambda scene, *_: protocol.emit(stage="encode", fraction=scene.frame_current / len(frames), message="encoding"))
    bpy.ops.render.render(animation=True, scene=scene.name)
    if not film.is_file() or not film.stat().st_size:
        raise LfsrError(f"{film} was not written: free some space or choose another folder")
    return film
