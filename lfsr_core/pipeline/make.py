"""Render, continue and finish: the one way from a request to finished frame folders. An image is one frame."""

import collections
import contextlib
import dataclasses
import math
import os
import shutil
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from pathlib import Path

from lfsr_core.base.messages import LfsrError, Notice, Progress, Tell, silent
from lfsr_core.base.records import write_record
from lfsr_core.base.system import RELEASED_FILE, atomic_path, remove, remove_dead, staging_folder, system_errors
from lfsr_core.frames.folder import FrameFolder, numbered, scene_stamp
from lfsr_core.frames.frame import LOG_FILE, SUBPIXELS, Finish, Request, check_scene, spread
from lfsr_core.optics.depth_scale import ScaleChoice
from lfsr_core.pipeline.parts import has_parts
from lfsr_core.process.child import FAILED_STAGE, RENDERED_STAGE, STAY, Child, CrashError, Starts, find_blender, told_of
from lfsr_core.reconstruct.averaging import near
from lfsr_core.reconstruct.methods import check_runs, seconds
from lfsr_core.reconstruct.second_stage import check_subpixels_finish, finish_frame

REQUEST_FILE = "request.json"
RENDER_FRACTION = 0.85  # of the time of one frame that is rendered and finished
MADE, KEPT, FAILED = "made", "kept", "failed"
LEAST_LEFT = 0.5  # seconds
PACE = 0.85  # time of Cycles' later samples of one image, as a fraction of the mean of those before them
LATE = 0.1  # work that is silent for longer than expected takes at least this fraction of its silence more
BEATS, LEAST_BEATS = 12, 2.0  # the last reports, and the least seconds that they span, which give the recent speed
LEAST_RATE = 0.1  # CPU seconds per second; below, the process waits for a GPU


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


def make(request: Request | Sequence[Request], finish: Finish | None = None, frames: Sequence[int] | None = None, *,
         blender: str | Starts | None = None, tell: Tell = silent, overwrite: bool = False, lenient: bool = False,
         chunk: int = 16) -> list[Made]:
    """Render and finish every frame that is not there, and return the outcome of each.

    A long render continues where the last one ended. Blender stays open over several frames, and frames are finished
    while the next ones render.

    Parameters
    ----------
    request : what is rendered; its output is the frame folder, or the folder of the frames' folders. Several requests,
        without ``frames``, are rendered by one Blender and fail together
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
    several = (request,) if isinstance(request, Request) else request
    content = {asked.scene: scene_stamp(check_scene(asked.scene)) for asked in several}
    requests = [asked for given in several for asked in requests_of(given, finish, frames, overwrite)]
    if not requests:
        return []
    # Numbers of the frames, rendered or asked for, that each is averaged with.
    averaging, beside = finish.temporal_averaging if finish else 0, collections.defaultdict[str, list[int]](list)
    for asked in requests if averaging else ():
        if asked.frame is not None:
            numbers = {*numbered(Path(asked.output).parent),
                       *(other.frame for other in requests if other.frame is not None)}
            beside[asked.output] = near(asked.frame, numbers, averaging)
    kept, waiting, ready, older = set[str](), list[Request](), list[Request](), list[int]()
    for asked in requests:
        folder = FrameFolder(asked.output)
        folder.check_free(asked.kind)
        before = None if overwrite else folder.readable
        if before is not None and not lenient:
            folder.check_rendered(asked, content[asked.scene], advice="overwrite it, or choose another folder")
        if overwrite or not folder.is_rendered(asked):
            waiting.append(asked)
            continue
        remove_dead(folder.path)
        if finish is None or folder.is_finished(finish, beside[asked.output]):
            kept.add(asked.output)
            if before is not None and before.content and before.content != content[asked.scene]:
                older.append(before.frame)
        else:
            ready.append(asked)
    if older:
        tell(Notice("frames-older", {"count": len(older), "first": older[0]}))

    first = several[0]
    if finish is not None and (waiting or ready):  # before a render, which may be long
        if first.kind != "render":
            raise LfsrError(f"kind is {first.kind!r}, expected 'render': make references with `lfsr reference`")
        if first.layout == SUBPIXELS:
            check_subpixels_finish(finish)
        check_runs(finish.method, finish.weights)

    failed, count = dict[str, str](), len(waiting)
    finishing: list[tuple[Request, Future[None]]] = []
    thread, stopped = ThreadPoolExecutor(1, "lfsr-finish"), threading.Event()
    after = 0.0 if finish is None else seconds(first.display, first.sampling.scale, finish.method, first.layout)
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
            tell(dataclasses.replace(whole, fraction=whole.fraction * (RENDER_FRACTION if finish else 1.0), left=left))
        else:
            detail = f"frame {waiting[0].frame}, {done + 1} of {count}"
            tell(dataclasses.replace(whole, stage="frames", detail=detail, left=left))

    def finish_one(asked: Request) -> None:
        """Finish a rendered frame, in a thread of its own beside Blender."""
        def stop_or_tell(told: Progress | Notice) -> None:
            if stopped.is_set():
                raise CancelledError
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

    def done(asked: Request, error: LfsrError | None = None) -> None:
        if error is not None and frames is None:
            raise error
        waiting.remove(asked)
        if error is None:
            ready.append(asked)
        else:
            failed[asked.output] = str(error)
            tell(Notice("frame-left-out", {"frame": asked.frame, "error": str(error)}))
        finish_ready()

    try:
        finish_ready()
        if waiting:
            starts = find_blender(blender) if blender is None or isinstance(blender, str) else blender
            crashed = ""
            while waiting:
                try:
                    render_all(waiting[:chunk], starts, heard, done, done)
                except CrashError as error:
                    if frames is None or not waiting:
                        raise
                    if crashed == (crashed := waiting[0].output):  # a second try may succeed
                        done(waiting[0], error)
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
    made = []
    for asked in requests:
        if asked.output in failed:
            made.append(Made(asked.frame, asked.output, FAILED, failed[asked.output]))
            continue
        folder = FrameFolder(asked.output)
        spent = folder.report.seconds if finish is not None else {}
        made.append(Made(asked.frame, asked.output, KEPT if asked.output in kept else MADE,
                         render=folder.part.seconds.get("render", 0.0),
                         finish=sum(value for stage, value in spent.items() if stage != "render")))
    return made


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
            frame = folder.readable
            if frame is not None and frame.display == request.display and frame.scale in request.sampling.scales:
                request = request.with_scale(ScaleChoice(frame.scale, frame.scale_reason))
                break
    if request.sampling.scales and not request.sampling.frames:
        request = request.sampled(frames=spread(frames))
    seeds = finish.seeds_of(request.seed, frames) if finish else {}
    return [dataclasses.replace(request, frame=number, output=str(FrameFolder.of_frame(output, number).path),
                                seed=seeds.get(number, request.seed)) for number in dict.fromkeys(frames)]


def render_all(requests: Sequence[Request], blender: Starts, tell: Tell = silent,
               rendered: Callable[[Request], object] = lambda request: None,
               failed: Callable[[Request, LfsrError], object] | None = None) -> None:
    """Render ``requests`` one after the other in one Blender, which opens a scene once for all in a row that use it.

    Each folder is published once it is rendered, whole or not at all; then ``rendered`` is called with its request.
    ``failed`` is called for a frame that cannot be rendered; None to raise the error. A long render that ends early
    leaves its finished parts, from which the same request continues. LfsrError with Blender's sentence after bad input;
    CrashError with the last lines of its log, which the folder then holds; KeyboardInterrupt once Blender is stopped.
    """
    with contextlib.ExitStack() as stack:
        waiting = list[tuple[Request, Path]]()
        for request in requests:
            try:
                FrameFolder(request.output).check_free(request.kind)
                waiting.append((request, stack.enter_context(staging_folder(Path(request.output)))))
            except LfsrError as error:  # as where another process renders this frame
                if failed is None:
                    raise
                failed(request, error)
        if not waiting:
            return
        try:
            with system_errors():
                last = waiting[-1]
                for request, staging in waiting:  # Blender fills the folder "frame" beside its request
                    (frame := staging / "frame").mkdir()
                    write_record(staging / REQUEST_FILE, dataclasses.replace(
                        request, output=str(frame), parts=str(FrameFolder(request.output).parts)))
                files = [staging / REQUEST_FILE for _, staging in waiting]
                temporary = last[1] / "temporary"  # not the system's, where a Blender that is killed leaves its files
                temporary.mkdir()
                environment = os.environ | dict.fromkeys(("TMPDIR", "TMP", "TEMP"), str(temporary))
                log_file = last[1] / LOG_FILE
                with (log_file.open("w", encoding="utf-8") as log,
                      Child(blender.command(*files), environment, log.write) as child):
                    for record in child.records():
                        if record["stage"] == RENDERED_STAGE:
                            request, staging = waiting.pop(0)
                            FrameFolder(request.output).publish(staging / "frame")
                            (staging / RELEASED_FILE).touch()  # whoever is told of the render may finish it
                            if waiting:  # the last staging folder has the log
                                remove(staging)
                            rendered(request)
                        elif record["stage"] == FAILED_STAGE and failed is not None:
                            failed(waiting[0][0], LfsrError(record["message"]))
                            del waiting[0]
                        elif (told := told_of(record)) is not None:
                            tell(told)
                    if not child.is_done() or waiting:
                        log.flush()
                        stored = Path((waiting or [last])[0][0].output, LOG_FILE)
                        with atomic_path(stored) as copy:
                            shutil.copyfile(log_file, copy)
                        raise child.crash("Blender stopped with", f"the whole log is {stored}")
        except BaseException:
            if waiting and has_parts(parts := FrameFolder(waiting[0][0].output).parts):
                tell(Notice("parts-kept", {"folder": str(parts)}))
            raise


@contextlib.contextmanager
def open_blender(blender: Starts, folder: Path) -> Iterator[Callable[[Request, Tell], None]]:
    """Keep one Blender open inside the block, for renders that depend on the ones before, as in a plan.

    Yields the function that renders a request into its folder, whole or not at all. ``folder``: for Blender's temporary
    files. Errors as of ``render_all``.
    """
    with contextlib.ExitStack() as stack:
        opened: list[Child] = []

        def render(request: Request, tell: Tell) -> None:
            check_scene(request.scene)
            if not opened:  # Blender starts with the first render, which may never come
                folder.mkdir(parents=True, exist_ok=True)
                temporary = stack.enter_context(
                    tempfile.TemporaryDirectory(dir=folder.resolve(), ignore_cleanup_errors=True))
                environment = os.environ | dict.fromkeys(("TMPDIR", "TMP", "TEMP"), temporary)
                opened.append(stack.enter_context(Child(blender.command(STAY), environment)))
            child, target = opened[0], FrameFolder(request.output)
            target.check_free(request.kind)
            with staging_folder(target.path) as staging, system_errors():
                (frame := staging / "frame").mkdir()
                write_record(staging / REQUEST_FILE, dataclasses.replace(request, output=str(frame)))
                child.ask(str(staging / REQUEST_FILE))
                for record in child.records():
                    if record["stage"] == RENDERED_STAGE:
                        target.publish(frame)
                        return
                    if (told := told_of(record)) is not None:
                        tell(told)
                child.wait()  # raises Blender's own sentence
                raise child.crash("Blender stopped with", "try again")

        yield render


class TimeLeft:
    """Follows one piece of work; every ``now`` is of one clock that only runs forward.

    The rest takes as long per fraction as what is done. Other programs take and release cores meanwhile: where the work
    has recently got fewer CPU seconds than before, the rest takes longer, by the square root of the ratio, since it may
    get them back. On 17 recorded renders the answer is right within a third, or 2 s, in 84 % of the looks.
    """

    def __init__(self, after: float = 0.0, is_image: bool = False) -> None:
        """``after``: seconds of what follows the work; ``is_image``: whether it is one image that Cycles renders."""
        self.after, self.is_image = after, is_image
        # Time, fraction done and CPU seconds until then, since the work itself began, after scenes were prepared.
        self._heard: list[tuple[float, float, float | None]] = []
        self._beats: list[tuple[float, float]] = []  # times and CPU seconds of the last reports
        self._ended = self._cpu = 0.0  # CPU seconds of processes that have ended, and of the one that works

    def hear(self, told: Progress, now: float) -> None:
        """Take a report."""
        cpu = None
        if told.cpu is not None:
            if told.cpu < self._cpu:  # of another process
                self._ended += self._cpu
            self._cpu = told.cpu
            cpu = self._ended + told.cpu
            self._beats = [*self._beats[1 - BEATS:], (now, cpu)]
        if told.repeated:
            return
        if not self._heard or told.fraction <= self._heard[0][1]:
            self._heard = [(now, told.fraction, cpu)]
        elif told.fraction > self._heard[-1][1]:
            self._heard.append((now, told.fraction, cpu))

    def left(self, now: float) -> float | None:
        """Seconds left, None while they cannot be told."""
        if len(self._heard) < 2:
            return None
        (began, first, cpu_before), (heard, done, cpu) = self._heard[0], self._heard[-1]
        silence, spent = now - heard, heard - began
        if done >= 1:
            return max(self.after - silence, LATE * silence, LEAST_LEFT)
        rest = spent / (done - first) * (1 - done)
        if self.is_image and len(self._heard) > 2:
            rest *= PACE
        if self._beats and spent > 0 and cpu_before is not None and cpu is not None:
            (begin, least), (end, most) = self._beats[0], self._beats[-1]
            if end - begin >= LEAST_BEATS:
                late, before = (most - least) / (end - begin), (cpu - cpu_before) / spent
                if late > LEAST_RATE and before > LEAST_RATE:
                    rest *= math.sqrt(before / late)
        return max(rest - silence, LATE * silence, LEAST_LEFT) + self.after
