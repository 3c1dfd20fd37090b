"""Accuracy and seconds of every candidate as a whole frame, and renders that are cut out of whole frames.

Such a folder holds per scene ``reference/`` and ``s{scale}-spp{n}/``, whole frame
folders of `lfsr reference` and `lfsr render`.
"""

from __future__ import annotations

import dataclasses
import functools
import re
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from einops import rearrange

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.frame import FRAME_FILE, LOW_RES_FILE, REFERENCE_FILES, Frame, read_frame, write_frame
from lfsr_core.frames.request import Request
from lfsr_core.images.exr import read_layers, write_layers
from lfsr_core.optics.eia import to_elemental_images
from lfsr_core.pipeline.make import finish_frame
from lfsr_core.plan.options import Candidate, PlanOptions, path_samples, render_seconds
from lfsr_core.reconstruct.second_stage import finished_linear
from lfsr_lab.experiments.engine.records import Records
from lfsr_lab.experiments.engine.renders import REFERENCE
from lfsr_lab.experiments.engine.timing import known_seconds, scratch_copy
from lfsr_lab.experiments.engine.truth import Truth

RENDER_FOLDER = re.compile(r"s(\d+)-spp(\d+)")
_read_layers = functools.lru_cache(maxsize=16)(read_layers)


@dataclasses.dataclass(frozen=True)
class Actual:
    """``accuracy`` by the metric of sampled lenses (docs/reference/metrics.md), ``seconds`` of the whole frame."""

    accuracy: float
    seconds: float


def scenes(bench: Path) -> list[Path]:
    """Return the folders of the scenes with a reference and at least one render."""
    return sorted(path.parents[1] for path in bench.glob(f"*/{REFERENCE}/{FRAME_FILE}") if renders(path.parents[1]))


def renders(scene: Path) -> dict[tuple[int, int], Path]:
    found = {}
    for path in scene.glob(f"s*-spp*/{FRAME_FILE}"):
        name = RENDER_FOLDER.fullmatch(path.parent.name)
        if name and (path.parent / LOW_RES_FILE).exists():
            found[int(name[1]), int(name[2])] = path.parent
    return found


def actuals(scene: Path, candidates: Sequence[Candidate], records: Records[Actual],
            rate: float | None = None) -> dict[Candidate, Actual]:
    """Return what candidates reach as whole frames, measured unless it is in ``records``; ``rate`` as ``timed_frame``.

    A candidate that cannot be made is left out; LfsrError where none can, or where the reference is of sampled lenses
    only: its own uncertainty would be as large as the plan's.
    """
    found = {}
    for candidate in candidates:
        try:
            found[candidate] = records.get(f"{candidate.name.replace(' ', '-')}-{PlanOptions.metric}", {"rate": rate}
                                           if rate else {}, functools.partial(_measure, scene, candidate, rate))
        except LfsrError as error:
            if candidate == candidates[-1] and not found:
                raise
            print(f"{scene.name}, {candidate.name}: {error}", file=sys.stderr)
    return found


def _measure(scene: Path, candidate: Candidate, rate: float | None) -> Actual:
    folder, target = renders(scene)[candidate.scale, candidate.samples], _target(scene / REFERENCE)
    target.check(read_frame(folder))
    similarity = target.lens_ssim(finished_linear(folder, candidate.method))
    with scratch_copy(folder) as copy:  # render, as it took then, and second stage, as it takes now
        write_frame(copy, timed_frame(folder, rate))
        seconds = finish_frame(copy, candidate.method).seconds
    return Actual(float(similarity.mean()), sum(seconds.values()))


@functools.lru_cache(maxsize=1)
def _target(folder: Path) -> Truth:
    """Read a reference, which must show every lens."""
    if read_frame(folder).lens_list is not None:
        raise LfsrError(f"the reference {folder} is of sampled lenses only, but all are needed: render it without "
                        "--lenses")
    return Truth(folder)


def timed_frame(folder: Path, rate: float | None = None) -> Frame:
    """Return the frame of a render with the seconds of its timed repeats (`lfsr study chart --times`), if any.

    With ``rate``, seconds of a path sample, those of its path samples alone: the machine was busy when it rendered.
    """
    frame = read_frame(folder)
    if rate:
        return dataclasses.replace(frame, seconds={"open": 0.0, "render": rate * path_samples(frame)})
    return dataclasses.replace(frame, seconds={**frame.seconds, "render": float(np.median(known_seconds(folder)))})


def setup_seconds(scene: Path, rate: float | None = None) -> float:
    """Return the seconds that every render of the scene takes whatever its size, from a fitted line."""
    frames = [timed_frame(folder, rate) for folder in renders(scene).values()]
    samples, seconds = np.array([(path_samples(frame), render_seconds(frame)) for frame in frames], float).T
    if len(set(samples)) < 2:
        return 0.0
    # By their inverse, so that seconds of short renders count as much as those of long ones.
    return float(np.clip(np.polyfit(samples, seconds, 1, w=1 / np.maximum(seconds, 1e-6))[1], 0, seconds.min()))


def replay(scene: Path, job: Request, rate: float | None = None) -> None:
    """Do ``job`` by cutting its lenses out of a whole frame of the folder, instead of rendering them.

    Seconds are the scene's set-up and what is left of the frame's, for as many pixels. A reference's two halves show
    the same half of the bench's, which of them the seed decides. ``rate`` as of ``timed_frame``.
    """
    source = _source(scene, job)
    frame, target = timed_frame(source, rate), Path(job.output)
    tiled = dataclasses.replace(frame, lens_list=job.lens_list, seed=job.seed, samples=job.sampling.samples)
    fraction = np.prod(tiled.rays.size) / np.prod(frame.rays.size) * job.sampling.samples / frame.samples
    target.mkdir(parents=True, exist_ok=True)
    names = REFERENCE_FILES if job.kind == "reference" else (LOW_RES_FILE,)
    part = int(target.name[-1]) if job.kind == "reference" else 0
    layers = _read_layers(source / names[part])
    cut = {layer: _cut(pixels, frame, tiled) for layer, pixels in layers.items()}
    for name in names:
        write_layers(target / name, cut)
    for name in frame.render_files[1:]:
        shutil.copy(source / name, target)
    whole, world = render_seconds(frame), 0.0 if job.world else frame.seconds.get("world", 0.0)
    setup = min(setup_seconds(scene, rate), whole)
    seconds = {**frame.seconds, "world": world, "render": world + setup + (whole - setup) * float(fraction)}
    write_frame(target, dataclasses.replace(tiled, seconds=seconds))


def _source(scene: Path, job: Request) -> Path:
    """The render asked for, else of the same scale the one of nearest samples: good enough for a quick look."""
    if job.kind == "reference":
        return scene / REFERENCE
    known = {spp: path for (scale, spp), path in renders(scene).items() if scale == job.sampling.scale}
    if not known:
        raise LfsrError(f"{scene} has no render of scale {job.sampling.scale}, which a plan starts from: render one")
    return known[min(known, key=lambda spp: abs(spp - job.sampling.samples))]


def _cut(pixels: Array, whole: Frame, tiled: Frame) -> Array:
    """Tiles (H, W, C) of the listed lenses, spare ones repeating the last, as RayLayout places them."""
    if tiled.lens_list is None:
        return pixels
    across, down = tiled.rays.tiles
    rows, columns = np.asarray(tiled.lens_list)[np.minimum(np.arange(across * down), len(tiled.lens_list) - 1)].T
    images = to_elemental_images(pixels, whole.rays.tiles)[rows, columns]
    return rearrange(images, "(down across) y x c -> (down y) (across x) c", down=down)
