"""The frames of an animation, each with a frame folder of its own, and what is still to be done for them."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Sequence
from pathlib import Path

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import reading
from lfsr_core.frames.averaging import check_averaging, seed_in_turn
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.frame import EIA_FILE, EIA_LINEAR_FILE, PANEL_FILE, SUBPIXELS, Frame, frame_folder, read_part
from lfsr_core.frames.identity import check_same, is_same, scene_stamp
from lfsr_core.frames.numbers import spread
from lfsr_core.frames.report import read_report
from lfsr_core.frames.request import Request
from lfsr_core.images.exr import check_complete
from lfsr_core.optics.depth_scale import ScaleChoice
from lfsr_core.pipeline.rendering import RENDERED_FILES, check_folder
from lfsr_core.pipeline.store import is_complete
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.reconstruct.neighbours import numbered, numbered_beside

PNG_END = b"IEND\xaeB`\x82"
TO_RENDER, TO_FINISH, DONE = "to render", "to finish", "done"


@dataclasses.dataclass(frozen=True)
class SecondStage:
    """How a rendered frame is finished."""

    method: str
    dilate: int = 0
    weights: str | None = None
    step: int | None = None
    linear_exr: bool = False
    temporal_averaging: int = 0

    @property
    def finish(self) -> Finish:
        """The same for ``finish_frame``."""
        return Finish(self.method, self.dilate, self.weights, self.linear_exr, self.temporal_averaging)

    def method_at(self, scale: int) -> MethodName:
        """The method for frames of ``scale``."""
        return MethodName.parse(self.method).at_scale(scale)


@dataclasses.dataclass(frozen=True)
class Animation:
    """Frames to render and to finish."""

    jobs: tuple[Request, ...]  # one per frame, all of one scene
    second: SecondStage
    content: str = ""  # stamp of the scene's file, empty where it is not known
    # render frames of other settings again instead of refusing them; another device or content is accepted
    lenient: bool = False


def kept_scale(job: Request) -> Request:
    """Return ``job`` at the scale of a frame that its output folder already holds, so that all frames have one."""
    for _, folder in sorted(numbered(Path(job.output)).items()) if job.sampling.scales else ():
        found = _readable(folder)
        if found is not None and found.display == job.display and found.scale in job.sampling.scales:
            return job.with_scale(ScaleChoice(found.scale, found.scale_reason))
    return job


def animation_of(job: Request, frames: Sequence[int], second: SecondStage, lenient: bool = False) -> Animation:
    """Return the animation of ``frames`` of the scene of ``job``, in folders such as ``0001`` in its output.

    A job that chooses its scale chooses one for all frames, by the depth of a few of them.
    With temporal averaging, neighbouring frames have different seeds; without it, all have the seed of ``job``, so
    that the noise does not move. ``lenient``: as of ``Animation``.
    """
    output = Path(job.output)
    if is_complete(output, "render") or is_complete(output, "reference"):
        raise LfsrError(f"{output} is a frame folder itself: choose another folder for the frames of an animation")
    check_averaging(second.temporal_averaging)
    if job.sampling.scales and not job.sampling.frames:
        job = job.sampled(frames=spread(frames))
    jobs = tuple(dataclasses.replace(job, frame=number, output=str(frame_folder(output, number)),
                                     seed=seed_in_turn(job.seed, number, second.temporal_averaging))
                 for number in frames)
    return Animation(jobs, second, scene_stamp(job.scene), lenient)


def state(animation: Animation, job: Request) -> str:
    """Return TO_RENDER, TO_FINISH or DONE for a frame; LfsrError where its folder holds another render."""
    folder = Path(job.output)
    check_folder(folder, job.kind)
    frame = _readable(folder)
    if frame is None or (animation.lenient and not is_same(frame, job)):
        return TO_RENDER
    if not animation.lenient:
        check_same(folder, job, animation.content, None, "give --overwrite, or choose another folder")
    if not all(_is_complete(folder / name) for name in RENDERED_FILES[job.kind]):
        return TO_RENDER
    return DONE if _is_finished(animation, job) else TO_FINISH


def beside(animation: Animation, job: Request) -> set[str]:
    """Return the folders of the frames that the frame of ``job`` is averaged with."""
    planned = (other.frame for other in animation.jobs if other.frame is not None)
    return set(map(str, numbered_beside(Path(job.output), animation.second.temporal_averaging, planned)))


def is_older(animation: Animation, job: Request) -> bool:
    """True if a frame was rendered before the scene's file was changed."""
    frame = _readable(Path(job.output))
    return bool(animation.content and frame and frame.content and frame.content != animation.content)


def _readable(folder: Path) -> Frame | None:
    with contextlib.suppress(LfsrError):
        return read_part(folder)
    return None


def _is_complete(path: Path) -> bool:
    with contextlib.suppress(LfsrError):
        check_complete(path)
        return True
    return False


def _is_finished(animation: Animation, job: Request) -> bool:
    """True if the image is there, made in the way asked for and with every neighbouring frame."""
    folder, second = Path(job.output), animation.second
    try:
        report = read_report(folder)
    except LfsrError:
        return False
    if dataclasses.replace(report.finish, linear_exr=second.linear_exr) != second.finish:
        return False
    if second.linear_exr and not _is_complete(folder / EIA_LINEAR_FILE):
        return False
    return (_ends_as_png(folder / (PANEL_FILE if report.layout == SUBPIXELS else EIA_FILE))
            and all(int(Path(other).name) in report.neighbours for other in beside(animation, job)))


def _ends_as_png(path: Path) -> bool:
    with contextlib.suppress(OSError, LfsrError), reading(path, "a PNG image") as file:
        file.seek(-min(len(PNG_END), path.stat().st_size), 2)
        return file.read() == PNG_END
    return False
