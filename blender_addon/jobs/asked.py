"""What a button asks for, from a scene's settings of now: the request and the finish of its frames."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.folder import FrameFolder, is_same
from lfsr_core.frames.frame import EIA_FILE
from lfsr_core.frames.request import Request, spread
from lfsr_core.pipeline.staging import has_parts
from lfsr_core.reconstruct.methods import MethodName

from ..scene import folders
from ..scene import settings as scene_settings
from ..scene.files import unreadable
from ..scene.image_before import reduced
from . import runtime

CONTINUE = "Render again to continue"


def asked(scene: bpy.types.Scene, frame: int | None = None) -> tuple[Request, Finish]:
    """Request and finish of a frame, by default the current one; LfsrError where it cannot be rendered."""
    settings = scene_settings.resolve_for_render(scene)
    number = scene.frame_current if frame is None else frame
    # A second stage that cannot start should be an error before the render, not after it.
    runtime.second_stage_command(runtime.RUNNER)
    # The artist was asked about what is missing.
    return dataclasses.replace(settings.request, output=str(folders.frame_folder(scene, number)), frame=number,
                               source=folders.source_of(scene),
                               allow_missing=bool(unreadable(scene, number, deep=False))), settings.finish


def timeline(scene: bpy.types.Scene) -> tuple[int, ...]:
    """Numbers of the frames of the timeline's range."""
    return tuple(range(scene.frame_start, scene.frame_end + 1, scene.frame_step))


def asked_animation(scene: bpy.types.Scene) -> tuple[Request, Finish, tuple[int, ...]]:
    """Request, finish and numbers of the timeline's frames; the output is the folder of their folders."""
    frames = timeline(scene)
    request, finish = asked(scene, frames[0])
    request = dataclasses.replace(request, output=str(Path(request.output).parent))
    return (request.sampled(frames=spread(frames) if request.sampling.scales else ()),
            finish, frames)


def test_request(scene: bpy.types.Scene, request: Request) -> Request | None:
    """Request of the test image of a frame, among this session's temporary files; None where it needs none."""
    settings = reduced(scene_settings.resolve(scene))
    if settings is None:
        return None
    folder = Path(request.output)
    output = runtime.temporary("test", folder) / folder.parent.name / "Test"
    return dataclasses.replace(settings.request, output=str(output), frame=request.frame, source=request.source)


def is_made(request: Request, finish: Finish) -> bool:
    """True if the folder of ``request`` holds its image, made by this method, temporally averaged or not."""
    folder = FrameFolder(request.output)
    try:
        frame, report = folder.rendered, folder.report
    except LfsrError:
        return False
    # In an animation with temporal averaging neighbouring frames have seeds of their own.
    request = dataclasses.replace(request, seed=report.finish.seed_of(request.seed, frame.frame))
    return (folder.image.is_file() and is_same(frame, request)
            and MethodName.parse(report.finish.method) == MethodName.parse(finish.method))


def kept(folder: Path) -> str:
    """What to do about an image of which only a part, or only the render, is there; "" where there is neither."""
    if folders.is_unfinished(folder):
        return "The render is kept: finish it with another method"
    return CONTINUE if has_parts(FrameFolder(folder).parts) else ""


def views_file(folder: Path) -> Path:
    """File of a frame folder's decoded views, among this session's temporary files."""
    return runtime.temporary("views", folder).with_suffix(".npy")


def is_decoded(folder: Path) -> bool:
    """True if the decoded views are there and not older than the image."""
    views, image = views_file(folder), folder / EIA_FILE
    return views.is_file() and image.is_file() and views.stat().st_mtime >= image.stat().st_mtime
