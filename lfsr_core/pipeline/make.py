"""Render, continue and finish: the one way from a request to finished frame folders. An image is one frame."""

from __future__ import annotations

import collections
import dataclasses
import os
import threading
import time
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice, Progress, Tell, silent
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.folder import FrameFolder, numbered, scene_stamp
from lfsr_core.frames.request import Request, check_scene, spread
from lfsr_core.optics.depth_scale import ScaleChoice
from lfsr_core.pipeline.finishing import finish_frame
from lfsr_core.pipeline.rendering import render_all
from lfsr_core.pipeline.staging import remove_dead
from lfsr_core.pipeline.time_left import TimeLeft
from lfsr_core.process.blender import Starts, find_blender
from lfsr_core.process.child import CrashError
from lfsr_core.reconstruct.averaging import near
from lfsr_core.reconstruct.methods import seconds

CHUNK = 16  # frames of one Blender
TRIES = 2  # of a frame of an animation at which Blender crashes
RENDER_FRACTION = 0.85  # of the time of one frame that is rendered and finished
MADE, KEPT, FAILED = "made", "kept", "failed"


@dataclasses.dataclass(frozen=True)
class Made:
    """The outcome of a frame."""

    frame: int | None  # None for the scene's current one
    folder: str
    state: str  # MADE, KEPT or FAILED
    error: str = ""  # the sentence, where it failed
    # seconds of the render and of all that follows it, 0 where it failed
    render: float = 0.0
    finish: float = 0.0


class _StoppedError(Exception):
    """The second stage is to stop."""


def make(request: Request, finish: Finish | None = None, frames: Sequence[int] | None = None, *,
         blender: str | Starts | None = None, tell: Tell = silent, overwrite: bool = False, lenient: bool = False,
         chunk: int = CHUNK) -> list[Made]:
    """Render and finish every frame that is not there, and return the outcome of each.

    A long render continues where the last one ended. Blender stays open over several frames, and frames are finished
    while the next ones render.

    Parameters
    ----------
    request : what is rendered; its output is the frame folder, or the folder of the frames' folders
    finish : how frames are finished, None to render only
    frames : numbers of the frames of an animation, each in a folder such as ``0001``; None for one frame
    blender : executable, what knows how to start Blender, or None for the best there is
    tell : called with ``Progress``, of all the work, and ``Notice``
    overwrite : render frames again that are there
    lenient : render frames again that have other settings instead of refusing them, and keep those of another device
        or of an older version of the scene's file, with a notice
    chunk : frames that one Blender renders

    LfsrError for bad input, with Blender's own sentence, or where a folder holds another render. One frame raises its
    error; of an animation, a frame that fails is left out and the others continue. KeyboardInterrupt once Blender is
    stopped: at most the frames in work are lost.
    """
    content = scene_stamp(check_scene(request.scene))
    requests = requests_of(request, finish, frames, overwrite)
    beside = {asked.output: _beside(asked, requests, finish) for asked in requests}
    kept, waiting, ready, older = set[str](), list[Request](), list[Request](), list[int]()
    for asked in requests:
        folder = FrameFolder(asked.output)
        folder.check_free(asked.kind)
        found = None if overwrite else folder.readable
        if found is not None and not lenient:
            folder.check_rendered(asked, content, advice="overwrite it, or choose another folder")
        if overwrite or not folder.is_rendered(asked):
            waiting.append(asked)
            continue
        remove_dead(folder.path)
        if finish is None or folder.is_finished(finish, beside[asked.output]):
            kept.add(asked.output)
            if found is not None and found.content and found.content != content:
                older.append(found.frame)
        else:
            ready.append(asked)
    if older:
        tell(Notice("frames-older", {"count": len(older), "first": older[0]}))

    failed, count = dict[str, str](), len(waiting)
    finishing: list[tuple[Request, Future[None]]] = []
    thread, stopped = ThreadPoolExecutor(1, "lfsr-finish"), threading.Event()
    after = 0.0 if finish is None else seconds(request.display, request.sampling.scale, finish.method, request.layout)
    time_left, most = TimeLeft(after, is_image=frames is None), [0.0]  # and the largest fraction that was told

    def heard(told: Progress | Notice) -> None:
        """Tell how far all of the work is while Blender renders, and what it says."""
        if isinstance(told, Notice) or told.stage != "render" or not waiting:
            tell(told)
            return
        done = count - len(waiting)
        whole = dataclasses.replace(told, fraction=(done + told.fraction) / count)
        time_left.hear(whole, time.monotonic())
        left = time_left.left(time.monotonic())
        if frames is None:
            tell(dataclasses.replace(told, fraction=told.fraction * (RENDER_FRACTION if finish else 1.0), left=left))
        else:
            detail = f"frame {waiting[0].frame}, {done + 1} of {count}"
            tell(dataclasses.replace(whole, stage="frames", detail=detail, left=left))

    def finish_one(asked: Request) -> None:
        """Finish a rendered frame, in a thread of its own beside Blender."""
        def stop_or_tell(told: Progress | Notice) -> None:
            if stopped.is_set():
                raise _StoppedError
            if frames is None and isinstance(told, Progress):
                begin = RENDER_FRACTION if count else 0.0
                # The other stages are short.
                share = told.fraction if told.stage in ("upscale", "write") else 0.0
                most[0] = max(most[0], begin + (1 - begin) * share)
                tell(dataclasses.replace(told, fraction=most[0], left=time_left.left(time.monotonic())))

        assert finish is not None, "nothing is finished otherwise"
        finish_frame(asked.output, finish, stop_or_tell)

    def finish_ready() -> None:
        """Finish the rendered frames whose neighbours are rendered; those that wait are on disk, not in memory."""
        missing = {asked.frame for asked in waiting}
        for asked in [asked for asked in ready if missing.isdisjoint(beside[asked.output])]:
            ready.remove(asked)
            if finish is not None:
                finishing.append((asked, thread.submit(finish_one, asked)))

    def rendered(asked: Request) -> None:
        waiting.remove(asked)
        ready.append(asked)
        finish_ready()

    try:
        finish_ready()
        if waiting:
            starts = find_blender(blender) if blender is None or isinstance(blender, str) else blender
            crashes = collections.Counter[str]()
            while waiting:
                try:
                    render_all(waiting[:chunk], starts, heard, rendered)
                except CrashError as error:
                    current = waiting[0]
                    crashes[current.output] += 1
                    if frames is None:
                        raise
                    if crashes[current.output] >= TRIES:
                        failed[waiting.pop(0).output] = str(error)
                        finish_ready()
                        tell(Notice("frame-left-out", {"frame": current.frame, "error": str(error)}))
        for asked, work in finishing:
            if frames is not None and (not work.done() or work is finishing[-1][1]):  # progress ends at 1
                tell(Progress("frames", 1.0, f"finishing frame {asked.frame}"))
            try:
                work.result()
            except LfsrError as error:
                if frames is None:
                    raise
                failed[asked.output] = str(error)
    finally:
        stopped.set()
        thread.shutdown(wait=True, cancel_futures=True)
    return [_made(asked, failed.get(asked.output, ""), asked.output in kept, finish) for asked in requests]


def requests_of(request: Request, finish: Finish | None, frames: Sequence[int] | None,
                overwrite: bool = False) -> list[Request]:
    """Return a request for each frame, in a folder of its own; LfsrError where the output is a frame folder itself.

    A scale that the depth decides is one for all frames: that of a frame which is there already, else by the depth of
    a few of them.
    """
    if frames is None:
        return [request]
    output = Path(os.path.abspath(request.output))
    if any(FrameFolder(output).holds(kind) for kind in ("render", "reference")):
        raise LfsrError(f"{output} is a frame folder itself: choose another folder for the frames of an animation")
    if request.sampling.scales and not overwrite:
        for _, folder in sorted(numbered(output).items()):
            found = folder.readable
            if found is not None and found.display == request.display and found.scale in request.sampling.scales:
                request = request.with_scale(ScaleChoice(found.scale, found.scale_reason))
                break
    if request.sampling.scales and not request.sampling.frames:
        request = request.sampled(frames=spread(frames))
    return [dataclasses.replace(request, frame=number, output=str(FrameFolder.of_frame(output, number).path),
                                seed=finish.seed_of(request.seed, number) if finish else request.seed)
            for number in frames]


def _beside(asked: Request, requests: Sequence[Request], finish: Finish | None) -> list[int]:
    """Return the numbers of the frames that a frame is averaged with, of those rendered or asked for."""
    if finish is None or not finish.temporal_averaging or asked.frame is None:
        return []
    numbers = {*numbered(Path(asked.output).parent), *(other.frame for other in requests if other.frame is not None)}
    return near(asked.frame, numbers, finish.temporal_averaging)


def _made(asked: Request, error: str, kept: bool, finish: Finish | None) -> Made:
    if error:
        return Made(asked.frame, asked.output, FAILED, error)
    folder = FrameFolder(asked.output)
    seconds = folder.report.seconds if finish is not None else {}
    return Made(asked.frame, asked.output, KEPT if kept else MADE,
                render=folder.part.seconds.get("render", 0.0),
                finish=sum(value for stage, value in seconds.items() if stage != "render"))
