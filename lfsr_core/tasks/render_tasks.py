"""Tasks of the add-on that start renders in Blender; each takes and returns JSON-ready data."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from lfsr_core.base.notices import Notice
from lfsr_core.base.records import from_data, to_data
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.frames.request import Request
from lfsr_core.plan.candidates import Candidate
from lfsr_core.process.protocol import emit_progress, emit_told, emit_warning


@dataclasses.dataclass(frozen=True)
class RenderCommand:
    """Command of the add-on that starts Blender; a ``process.blender.Starts``."""

    words: tuple[str, ...]

    def command(self, *request_files: Path) -> list[str]:
        """Return the command line that renders ``request_files``."""
        return [*self.words, *map(str, request_files)]


def make(request: dict[str, Any], finish: dict[str, Any], command: list[str], frames: list[int] | None = None,
         overwrite: bool = False, test: dict[str, Any] | None = None, views: str | None = None) -> dict[str, Any]:
    """Make an image, or the ``frames`` of an animation that are not there; see ``pipeline.make``.

    ``command``: words that start a render, before the request files; ``test``: request of a small image that is made
    first, told by the notice "test-made"; ``views``: file for the decoded views of the last frame. Frames of other
    settings are rendered again, since the panel shows what is wanted. Returns {"made": data of every ``Made``}.
    """
    from lfsr_core.pipeline.make import FAILED
    from lfsr_core.pipeline.make import make as make_frames

    blender, wanted = RenderCommand(tuple(command)), from_data(Finish, finish, "the finish")
    if test is not None:
        small = from_data(Request, test, "the request of the test image")
        make_frames(small, dataclasses.replace(wanted, linear_exr=False), blender=blender, tell=emit_told,
                    overwrite=True)
        emit_told(Notice("test-made", {"folder": small.output}))
    made = make_frames(from_data(Request, request, "the request"), wanted, frames, blender=blender, tell=emit_told,
                       overwrite=overwrite or frames is None, lenient=True)
    if views and made[-1].state != FAILED and not FrameFolder(made[-1].folder).rendered.panel_rays:
        from lfsr_core.tasks.folder_tasks import decode

        decode(made[-1].folder, views)
    return {"made": [to_data(result) for result in made]}


def reference(request: dict[str, Any], folder: str, lenses: int, command: list[str]) -> dict[str, Any]:
    """Render the reference of a finished frame ``folder`` for ``lenses`` random lenses (0: all), and compare.

    Returns the "metrics" of the frame's report.
    """
    from lfsr_core.frames.frame import MASK_FILE
    from lfsr_core.images.png import read_mask
    from lfsr_core.metrics.compare import compare_folders
    from lfsr_core.optics.lens_sampling import choose_lenses
    from lfsr_core.pipeline.make import make as make_frames

    wanted, finished = from_data(Request, request, "the request"), FrameFolder(folder)
    mask = read_mask(finished.path / MASK_FILE, finished.frame.display.lenses)
    if 0 < lenses < mask.size:
        wanted = dataclasses.replace(wanted, lens_list=choose_lenses(mask, lenses, wanted.seed))
    make_frames(wanted, blender=RenderCommand(tuple(command)), tell=emit_told, overwrite=True)
    compare_folders(folder, wanted.output)
    return {"metrics": finished.report.metrics}


@dataclasses.dataclass(frozen=True)
class Found:
    """Result of a plan, for the panel."""

    sentence: str
    chosen: Candidate | None  # the cheapest that reaches the target, None if there is none


def plan(request: dict[str, Any], options: dict[str, Any], command: list[str], work: str) -> dict[str, Any]:
    """Plan for the scene of a job, with ``PlanOptions``; return data of a ``Found``.

    ``command``: words that start a render, before the job file; ``work``: folder for the sample.
    """
    from lfsr_core.pipeline.store import run_job
    from lfsr_core.plan.options import PlanOptions
    from lfsr_core.plan.planner import make_plan
    from lfsr_core.plan.report import sentence

    wanted, blender = from_data(PlanOptions, options, "options of the plan"), RenderCommand(tuple(command))
    choice = make_plan(from_data(Request, request, "the request"), wanted,
                       lambda job, progress: run_job(job, blender, progress, emit_warning), work, emit_progress).choice
    found: dict[str, Any] = to_data(Found(sentence(choice, wanted), choice.chosen.candidate if choice.chosen else None))
    return found
