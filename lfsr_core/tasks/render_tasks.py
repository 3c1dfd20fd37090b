"""Tasks of the add-on that start renders in Blender; each takes and returns JSON-ready data."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.notices import Notice, Progress, Tell
from lfsr_core.base.records import from_data, to_data, write_record
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.frames.request import Request
from lfsr_core.process.protocol import emit_told
from lfsr_core.tasks.command import RenderCommand

TEST_FRACTION = 0.05  # of the time of an image, its test image


def make(request: dict[str, Any], finish: dict[str, Any], command: list[str], frames: list[int] | None = None,
         overwrite: bool = False, views: str | None = None, test: dict[str, Any] | None = None,
         test_views: str | None = None) -> dict[str, Any]:
    """Make an image, or the ``frames`` of an animation that are not there; see ``pipeline.make``.

    ``command``: words that start a render, before the request files; ``views``: file for the decoded views of the last
    frame; ``test``: request of a small image that is made first, told by the notice "test-made", and its views. Frames
    of other settings are rendered again, since the panel shows what is wanted. Returns {"made": data of each ``Made``}.
    """
    from lfsr_core.pipeline.make import FAILED
    from lfsr_core.pipeline.make import make as make_frames
    from lfsr_core.tasks.folder_tasks import decode

    blender, wanted = RenderCommand(tuple(command)), from_data(Finish, finish, "the finish")
    if test is not None:
        small = from_data(Request, test, "the request of the test image")
        make_frames(small, dataclasses.replace(wanted, linear_exr=False), blender=blender, overwrite=True,
                    tell=part_of(emit_told, 0.0, TEST_FRACTION, "test"))
        if test_views:
            decode(small.output, test_views)
        emit_told(Notice("test-made", {"folder": small.output}))
    made = make_frames(from_data(Request, request, "the request"), wanted, frames, blender=blender,
                       overwrite=overwrite or frames is None, lenient=True,
                       tell=emit_told if test is None else part_of(emit_told, TEST_FRACTION, 1.0))
    if views and made[-1].state != FAILED and not FrameFolder(made[-1].folder).rendered.subpixels:
        decode(made[-1].folder, views)
    return {"made": [to_data(result) for result in made]}


def part_of(tell: Tell, begin: float, end: float, stage: str = "") -> Tell:
    """Return what tells progress as that of a part of the work; ``stage``: its name in place of those of the work."""
    def told(one: Progress | Notice) -> None:
        if isinstance(one, Progress):
            one = dataclasses.replace(one, fraction=begin + (end - begin) * one.fraction, stage=stage or one.stage,
                                      left=None if stage else one.left)
        tell(one)
    return told


def reference(request: dict[str, Any], output: str, lenses: int, samples: int, command: list[str]) -> dict[str, Any]:
    """Render the reference of the finished frame of a request, see ``metrics.compare.compare_with_reference``.

    Returns the "metrics" of the frame's report.
    """
    from lfsr_core.metrics.compare import compare_with_reference

    wanted = from_data(Request, request, "the request")
    compare_with_reference(wanted, wanted.output, output, lenses, samples, RenderCommand(tuple(command)), emit_told)
    return {"metrics": FrameFolder(wanted.output).report.metrics}


def estimate(request: dict[str, Any], command: list[str]) -> dict[str, Any]:
    """Measure how fast the scene of a request renders, from a few lenses; return data of a ``Measured``."""
    from lfsr_core.tasks.estimate import measure

    measured = measure(from_data(Request, request, "the request"), RenderCommand(tuple(command)), emit_told)
    return dataclasses.asdict(measured)


def plan(request: dict[str, Any], options: dict[str, Any], command: list[str]) -> dict[str, Any]:
    """Plan for the scene of a request, with ``PlanOptions``; return data of a ``plan.choose.Choice``.

    ``command``: words that start a render, before the request files. A first guess, from the depth of the scene, is
    told before anything is measured, by the notice "first-guess".
    """
    from lfsr_core.pipeline.make import make as make_frames
    from lfsr_core.plan.choose import first_guess
    from lfsr_core.plan.options import PlanOptions
    from lfsr_core.plan.planner import make_plan

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
