"""Measure how fast a scene renders, from a few of its lenses."""

from __future__ import annotations

import dataclasses
import math
import tempfile
import time
from pathlib import Path

import numpy as np

from lfsr_core.base.notices import Notice, Progress, Tell
from lfsr_core.frames.frame import LAYOUTS, SUBPIXELS, read_part
from lfsr_core.frames.request import Request
from lfsr_core.plan.options import path_samples, render_seconds
from lfsr_core.process.child import Starts

PATHS = 600_000  # path samples to measure: a second or two
SAMPLES = 16  # at most, so that many lenses are seen
LEAST_SIDE, SOME = 4, 4  # pixels that Blender renders, which lenses with a single row of views reach together


@dataclasses.dataclass(frozen=True)
class Measured:
    """What was measured of a scene."""

    fixed: float  # seconds before the first sample
    per_path: float  # seconds of a path sample
    scale: int  # that was rendered at, which Auto has chosen


def measure(request: Request, blender: Starts, tell: Tell) -> Measured:
    """Render a few lenses of ``request`` in one Blender.

    First one lens or a few, which prepare the scene, then some and many: their difference is that of their samples
    alone, since a change of lenses makes Cycles prepare some things again. Of a panel's subpixels lenses too: their
    paths are those of a light field of the same scene.
    """
    from lfsr_core.pipeline.make import render_all  # needs OpenImageIO, which Blender's panel does without

    started = time.monotonic()
    if request.layout == SUBPIXELS:
        request = dataclasses.replace(request, layout=LAYOUTS[0])
    samples, many = samples_of(request), lenses_of(request)
    few = max(math.ceil(LEAST_SIDE / views) for views in request.display.low_views(request.sampling.scale)) ** 2
    with tempfile.TemporaryDirectory() as folder:
        requests = [dataclasses.replace(request, output=str(Path(folder, str(len(lenses)))), lens_list=tuple(lenses),
                                        sampling=dataclasses.replace(request.sampling, rays=None, samples=samples))
                    for lenses in (many[:few], many[::SOME], many)]
        done: list[Request] = []

        def heard(told: Progress | Notice) -> None:
            if isinstance(told, Notice) or told.stage != "render":
                tell(told)
            else:
                tell(dataclasses.replace(told, stage="estimate", fraction=(len(done) + told.fraction) / len(requests)))

        render_all(requests, blender, heard, done.append)
        _, some, whole = (read_part(asked.output) for asked in requests)
    sampling = max(render_seconds(whole) - render_seconds(some), 0.0)
    # All but these two renders is needed once by the image too.
    fixed = max(time.monotonic() - started - some.seconds["render"] - whole.seconds["render"], 0.0)
    return Measured(fixed, sampling / max(path_samples(whole) - path_samples(some), 1), whole.scale)


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
