"""What Blender would write for a job of a synthetic light field: its light with noise that shrinks with the samples."""

import dataclasses
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lfsr_core.base.records import to_data
from lfsr_core.frames.frame import LOW_RES_FILE, REFERENCE_FILES, Request, read_request, write_frame
from lfsr_core.images.image_files import write_layers
from lfsr_core.optics.rays import pixel_rows
from lfsr_core.process.child import RENDERED_STAGE, STAY, emit
from tests.support.requests import make_request
from tests.support.synthetic import MINI, frame_of, light_field, tiles, traced_panel

NOISE = 0.3  # of one sample
SECONDS_PER_SAMPLE = 1e-5
LOG = "LFSR_TEST_JOBS"
UNSEEN = "Unseen"  # a subject that no lens sees
JOB = make_request(output=".", display=MINI, scene="scene.blend", seed=5)


def noisy(image: np.ndarray, spp: int, seed: int) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(0, NOISE / spp**0.5, image[..., :3].shape) * (image[..., 3:] > 0)
    return np.concatenate([np.maximum(image[..., :3] + noise, 0), image[..., 3:]], -1).astype(np.float32)


def render(job: Request) -> None:
    """What Blender would write for ``job`` of that light field."""
    frame = frame_of(1 if job.kind == "reference" else job.sampling.scale, job.display, samples=job.sampling.samples,
                     lens_list=job.lens_list, seed=job.seed, rows=job.rows, layout=job.layout,
                     **({} if job.frame is None else {"frame": job.frame}))
    folder, image = Path(job.output), traced_panel(job.display) if frame.subpixels else light_field(job.display)
    if job.lens_list is not None:
        image = tiles(image, dataclasses.replace(frame, scale=1))
    height, width, _ = image.shape
    across, down = (frame.scale if many else 1 for many in job.display.parallax)
    image = image.reshape(height // down, down, width // across, across, 4).mean((1, 3)) * (job.subject != UNSEEN)
    rows = (0, None) if job.rows is None else pixel_rows(job.rows, frame.rays.views[1])
    pairs = [(LOW_RES_FILE, job.sampling.samples)] if job.kind == "render" else [(name,
            job.sampling.samples // 2) for name in REFERENCE_FILES]
    for number, (name, spp) in enumerate(pairs):
        write_layers(folder / name, {"color": noisy(image, spp, job.seed + 10**6 * number)[slice(*rows)]})
    seconds = 0.01 + SECONDS_PER_SAMPLE * image[..., 0].size * job.sampling.samples
    write_frame(folder, dataclasses.replace(frame, seconds={"open": 1.0, "render": seconds}))


def play(arguments: Sequence[str]) -> int:
    """Do what Blender does: say its version, or run job files, with a line each in the environment's file ``LOG``."""
    if "--version" in arguments:
        print("Blender 5.0.1")
        return 0
    words = arguments[arguments.index("--") + 1:]
    for path in (line.strip() for line in sys.stdin) if words == [STAY] else words:
        job = read_request(path)
        if LOG in os.environ:
            with open(os.environ[LOG], "a") as log:
                log.write(json.dumps(to_data(job)) + "\n")
        render(job)
        emit(stage=RENDERED_STAGE)
    emit(stage="done", folder=".")
    return 0
