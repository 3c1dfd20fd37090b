"""How long an image will take, from a render of a few of its lenses."""

from __future__ import annotations

import dataclasses
import math
import time
from pathlib import Path

import bpy
import numpy as np

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.frame import SUBPIXELS, Frame, read_part
from lfsr_core.frames.request import Request
from lfsr_core.optics.depth_scale import samples_at
from lfsr_core.plan.times import path_samples, render_seconds

from ..scene import devices
from ..scene import settings as scene_settings
from ..scene.settings import Resolved
from . import estimate
from .copy import file_copy
from .steps import SAVING, Steps, render_step, write_job

PATHS = 600_000  # path samples to measure: a second or two
SAMPLES = 16  # at most, so that many lenses are seen
# Renders of one lens or a few, which prepare the scene, and of some and many: their difference is that of their samples
# alone, since a change of lenses makes Cycles prepare some things again.
NAMES, SOME = ("first", "some", "many"), 4
LEAST_SIDE = 4  # pixels that Blender renders, which lenses with a single row of views reach together
SECONDS = 12.0  # that a probe takes on a usual machine


@dataclasses.dataclass(frozen=True)
class Measured:
    """What a probe has found of a scene."""

    fixed: float  # seconds before the first sample
    per_path: float  # seconds of a path sample
    scale: int  # that was rendered at, which Auto has chosen


def measure(job: Request) -> Steps:
    """Render a few lenses of ``job`` in one background Blender; the result is a ``Measured``.

    Of a panel's subpixels too: their paths are those of a light field of the same scene.
    """
    started, image = time.monotonic(), job
    if job.layout == SUBPIXELS:
        job = dataclasses.replace(job, layout=devices.way_of(job.device))
    yield SAVING
    with file_copy() as copy:
        folder = copy.parent
        many = _lenses(job)
        few = max(math.ceil(LEAST_SIDE / views) for views in job.display.low_views(job.sampling.scale)) ** 2
        lenses = {"first": many[:few], "some": many[::SOME], "many": many}
        jobs = {name: dataclasses.replace(job, scene=str(copy), output=str(folder / name), parts=None,
                                          sampling=dataclasses.replace(job.sampling, rays=None, samples=_samples(job)),
                                          lens_list=tuple(lenses[name])) for name in NAMES}
        for each in jobs.values():
            Path(each.output).mkdir()
        step = render_step(jobs["first"], folder, 1.0, "Measuring lenses")
        others = [str(write_job(jobs[name], folder / f"{name}.json")) for name in NAMES[1:]]
        yield dataclasses.replace(step, command=[*step.command, *others], seconds=SECONDS)
        frames = {name: read_part(folder / name) for name in NAMES}
    measured = _measured(frames, time.monotonic() - started)
    estimate.learn_sampling(image, measured.per_path * estimate.paths(image))
    return measured


def _measured(frames: dict[str, Frame], wall: float) -> Measured:
    """``wall``: seconds from the start to the end of the probe."""
    some, many = frames["some"], frames["many"]
    paths = path_samples(many) - path_samples(some)
    sampling = max(render_seconds(many) - render_seconds(some), 0.0)
    # All but these two renders is needed once by the image too.
    fixed = max(wall - some.seconds["render"] - many.seconds["render"], 0.0)
    return Measured(fixed, sampling / max(paths, 1), many.scale)


def _lenses(job: Request) -> list[tuple[int, int]]:
    """Lenses (row, column) spread evenly over the display, enough for PATHS path samples."""
    columns, rows = job.display.lenses
    views = job.display.low_views(job.sampling.scale)
    count = min(max(PATHS // (views[0] * views[1] * _samples(job)), 1), rows * columns)
    across = min(columns, max(1, round((count * columns / rows) ** 0.5)))
    down = min(rows, max(1, round(count / across)))
    places = [((np.arange(number) + 0.5) / number * total).astype(int) for number, total in ((down, rows),
                                                                                            (across, columns))]
    return [(int(row), int(column)) for row in places[0] for column in places[1]]


def _samples(job: Request) -> int:
    """Samples per pixel: as many as the image's, so that Cycles works as for it, and more where it has few pixels."""
    rendered = job.display.eia_pixels[0] * job.display.eia_pixels[1] // job.display.finished_pixels(job.sampling.scale)
    return max(min(SAMPLES, job.sampling.samples), PATHS // rendered)


def remember(scene_name: str, measured: Measured) -> None:
    """Store what was found for the panel, and for other settings of the same scene."""
    state = bpy.context.window_manager.lfsr
    state.probe_scene = scene_name
    state.probe_fixed, state.probe_per_path, state.probe_scale = measured.fixed, measured.per_path, measured.scale


def expected_seconds(scene: bpy.types.Scene) -> float | None:
    """Seconds that an image of ``scene`` will take with its settings of now; None where nothing was measured."""
    state = bpy.context.window_manager.lfsr
    if state.probe_scene != scene.name_full:
        return None
    try:
        settings = scene_settings.resolve(scene)
        return _seconds(settings, Measured(state.probe_fixed, state.probe_per_path, state.probe_scale))
    except LfsrError:
        return None  # the panel says what is wrong


def _seconds(settings: Resolved, measured: Measured) -> float:
    display, scale = settings.display, measured.scale if settings.scales else settings.scale
    samples = settings.samples if settings.rays is None else samples_at(display, scale, settings.rays)
    rendered = estimate.finished_pixels(display, settings.is_direct) / display.finished_pixels(scale)
    finish = estimate.expected("Denoising" if settings.is_direct else "Upscaling", estimate.second_stage(
        display, scale, str(settings.method), settings.is_direct))
    return measured.fixed + measured.per_path * rendered * samples + finish
