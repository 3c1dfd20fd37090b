"""A shot: the frames of an animation, each with a frame folder of its own, and what of them is done already."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterable
from pathlib import Path

from lfsr_core.errors import LfsrError
from lfsr_core.frames.averaging import check_averaging, seed_in_turn
from lfsr_core.frames.frame import (
    EIA_FILE,
    EIA_LINEAR_FILE,
    PANEL_FILE,
    SUBPIXELS,
    Frame,
    frame_folder,
    read_part,
)
from lfsr_core.frames.identity import check_same, is_same, on_any_device
from lfsr_core.frames.job import Job
from lfsr_core.frames.report import read_report
from lfsr_core.images.exr import check_complete
from lfsr_core.reconstruct.neighbours import numbered_beside
from lfsr_core.reconstruct.options import UpscaleOptions
from lfsr_core.render.content import scene_content
from lfsr_core.render.process import RENDERED_FILES, check_folder
from lfsr_core.render.store import is_complete

PNG_END = b"IEND\xaeB`\x82"
TO_RENDER, TO_FINISH, DONE = "to render", "to finish", "done"


@dataclasses.dataclass(frozen=True)
class SecondStage:
    """How a rendered frame is finished."""

    method: str
    dilate: int = 0
    # weights, step, linear_exr: as of ``second_stage.UpscaleOptions``
    weights: str | None = None
    step: int | None = None
    linear_exr: bool = False
    # neighbouring frames to each side that are averaged where they show the same
    temporal_averaging: int = dataclasses.field(default=0, metadata={"key": "share_frames"})

    @property
    def options(self) -> UpscaleOptions:
        """For ``upscale_frame``."""
        return UpscaleOptions(self.step, self.dilate, weights=self.weights, linear_exr=self.linear_exr,
                              temporal_averaging=self.temporal_averaging)


@dataclasses.dataclass(frozen=True)
class Shot:
    """Frames to render and to finish."""

    jobs: tuple[Job, ...]  # one per frame, all of one scene
    second: SecondStage
    content: str = ""  # of the scene's file, empty where it is not known
    lenient: bool = False  # frames of other settings are made again; those of another device or content are kept


def shot_of(job: Job, frames: Iterable[int], second: SecondStage, lenient: bool = False) -> Shot:
    """Frames of the scene of ``job``, in folders such as ``0001`` in its output.

    Frames that share have as many seeds in turn as they are; others all have the job's, so that noise stands.
    ``lenient``: as of ``Shot``.
    """
    output = Path(job.output)
    if is_complete(output, "render") or is_complete(output, "reference"):
        raise LfsrError(f"{output} is a frame folder itself: choose another folder for the frames of an animation")
    check_averaging(second.temporal_averaging)
    jobs = tuple(dataclasses.replace(job, frame=number, output=str(frame_folder(output, number)),
                                     seed=seed_in_turn(job.seed, number, second.temporal_averaging))
                 for number in frames)
    return Shot(jobs, second, scene_content(job.scene), lenient)


def state(shot: Shot, job: Job) -> str:
    """What is still to be done for a frame: TO_RENDER, TO_FINISH or DONE; LfsrError where its folder holds another."""
    folder = Path(job.output)
    check_folder(folder, job.kind)
    frame = _readable(folder)
    if frame is None:
        return TO_RENDER
    if shot.lenient:
        if not is_same(frame, on_any_device(job)):
            return TO_RENDER
    else:
        check_same(folder, job, shot.content, None, "give --overwrite, or choose another folder")
    if not all(_is_whole(folder / name) for name in RENDERED_FILES[job.kind]):
        return TO_RENDER
    return DONE if _is_finished(folder, shot.second) and _has_shared(shot, job) else TO_FINISH


def beside(shot: Shot, job: Job) -> set[str]:
    """Folders of the frames that ``job`` shares with."""
    planned = (other.frame for other in shot.jobs if other.frame is not None)
    return set(map(str, numbered_beside(Path(job.output), shot.second.temporal_averaging, planned)))


def _has_shared(shot: Shot, job: Job) -> bool:
    """True if all that lie beside the frame were there when it was finished."""
    seen = read_report(job.output).neighbours
    return all(int(Path(folder).name) in seen for folder in beside(shot, job))


def is_older(shot: Shot, job: Job) -> bool:
    """True if a finished frame was rendered from the scene before its file was changed."""
    frame = _readable(Path(job.output))
    return bool(shot.content and frame and frame.content and frame.content != shot.content)


def _readable(folder: Path) -> Frame | None:
    with contextlib.suppress(LfsrError):
        return read_part(folder)
    return None


def _is_whole(path: Path) -> bool:
    try:
        check_complete(path)
    except LfsrError:
        return False
    return True


def _is_finished(folder: Path, second: SecondStage) -> bool:
    """True if the picture is there, made in this way."""
    try:
        report = read_report(folder)
    except LfsrError:
        return False
    if second.linear_exr and not _is_whole(folder / EIA_LINEAR_FILE):
        return False
    made = (report.method, report.dilate, report.weights, report.temporal_averaging)
    same = made == (second.method, second.dilate, second.weights, second.temporal_averaging)
    return same and _ends_as_png(folder / (PANEL_FILE if report.layout == SUBPIXELS else EIA_FILE))


def _ends_as_png(path: Path) -> bool:
    with contextlib.suppress(OSError), path.open("rb") as file:
        file.seek(-min(len(PNG_END), path.stat().st_size), 2)
        return file.read() == PNG_END
    return False
