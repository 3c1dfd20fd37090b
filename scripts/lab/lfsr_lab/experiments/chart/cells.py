"""The cells of a chart: renders of all seeds, each finished by every method and measured; and their times."""

from __future__ import annotations

import dataclasses
import importlib.util
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lfsr_core.base.messages import LfsrError
from lfsr_core.frames.frame import Request, Sampling, read_frame
from lfsr_core.metrics.eia_metrics import check_reference
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, UPSCALER, names
from lfsr_lab.experiments.chart.analysis import DIRECT, LOW, ChartSettings, Measured, Role, Times, short
from lfsr_lab.experiments.engine.records import Fingerprint, Records, StudySettings, frame_digest, method_facts
from lfsr_lab.experiments.engine.timing import StageTimes, scratch_copy, second_stage_times
from lfsr_lab.experiments.engine.truth import VERSION, Truth, errors
from lfsr_lab.networks.comparators import NETWORKS
from lfsr_lab.networks.methods import COMPARED

AS_RENDERED = "none"
DIRECT_METHODS = (AS_RENDERED, "oidn")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Settings(ChartSettings, StudySettings):
    """One chart: what decides its figures, and how it is run. LfsrError for numbers that cannot be."""

    output: Path  # output folder, with a folder per scene
    only_measure: bool = False  # new renders are refused
    times: bool = False  # what is not timed is timed
    device: str = "CPU"  # what Cycles renders on
    blender: str | None = None  # executable used instead of the one found

    def __post_init__(self) -> None:
        for name in ("spps", "direct_spps"):
            samples = getattr(self, name)
            if name == "spps" and not samples:
                raise LfsrError("there are no samples per pixel to measure at: give some with --spps, as in 1,4,16,64")
            if min(samples, default=1) < 1 or len(set(samples)) < len(samples):
                raise LfsrError(f"{name} are {', '.join(map(str, samples))}, but they must be different whole numbers "
                                "from 1")
        for name, least in (("seeds", 1), ("repeats", 1), ("reference_spp", 2)):
            if getattr(self, name) < least:
                raise LfsrError(f"{name} is {getattr(self, name)}, but it must be {least} or more")
        if self.ours not in self.methods:
            raise LfsrError(f"our method {self.ours!r} is not among those measured, {', '.join(self.methods)}: "
                            "add it to --methods or choose another with --ours")
        self.profile.low_views(self.scale)  # refuses a scale that does not divide them

    @property
    def profile(self) -> DisplayProfile:
        return load_display(self.display)

    @property
    def steps(self) -> int:
        """Renders and cells of a scene, with its reference."""
        return 1 + len(self.spps) * (1 + len(self.methods)) + len(self.direct_spps) * (1 + len(self.direct_methods))

    @property
    def figures(self) -> ChartSettings:
        return ChartSettings(**{field.name: getattr(self, field.name) for field in dataclasses.fields(ChartSettings)})


def default_methods() -> tuple[str, ...]:
    """Return the default, what it is compared with, and every upscaler alone and after the denoiser.

    Networks are among them where PyTorch is installed.
    """
    upscalers = [*names(UPSCALER), *(NETWORKS if importlib.util.find_spec("torch") else ())]
    upscaled = [name for upscaler in upscalers if upscaler != AS_RENDERED for name in (upscaler, f"denoise+{upscaler}")]
    return tuple(dict.fromkeys([DEFAULT_METHOD, *COMPARED, *upscaled]))


CELL_FOLDER, TIMES_FOLDER = "cells", "times"


@dataclasses.dataclass(frozen=True)
class Render:
    role: Role
    jobs: tuple[Request, ...]  # one per seed, that of seed 0 first

    @property
    def folders(self) -> list[Path]:
        return [Path(job.output) for job in self.jobs]

    @property
    def name(self) -> str:
        return self.folders[0].name

    def facts(self, name: str) -> Fingerprint:
        """Return what everything measured of it with a method depends on."""
        return {"frames": [frame_digest(folder) for folder in self.folders], **method_facts(name)}


def renders(settings: Settings, scene: Path) -> Iterator[Render]:
    """Yield every render of a scene, the cheap ones first."""
    wanted: list[tuple[Role, int, tuple[int, ...]]] = [
        (LOW, settings.scale, settings.spps), (DIRECT, 1, settings.direct_spps)]
    for role, scale, every in wanted:
        for samples in every:
            jobs = (job(settings, scene, scale, samples, seed) for seed in range(settings.seeds))
            yield Render(role, tuple(jobs))


def job(settings: Settings, scene: Path, scale: int, samples: int, seed: int = 0) -> Request:
    name = f"s{scale}-spp{samples}" + (f"-seed{seed}" if seed else "")
    return Request(output=str(settings.output / scene.stem / name), display=settings.profile,
                   scene=str(scene.resolve()), sampling=Sampling(scale, samples), device=settings.device, seed=seed,
                   subject=settings.subject, world_visible=settings.world_visible)


def measured(render: Render, name: str, truth: Truth) -> Measured:
    """Return the values of a render and a method, measured unless they are stored and still fit.

    LfsrError where the reference is not of the render, or where the method cannot finish it.
    """
    records = Records(render.folders[0].parent / CELL_FOLDER, Measured)
    facts = {"version": VERSION, "reference": frame_digest(truth.folder), **render.facts(name)}

    def measure() -> Measured:
        for folder in render.folders:
            check_reference(read_frame(folder), truth.reference.frame)
        lens_errors = errors(np.array([truth.finished(folder, name) for folder in render.folders]), *truth.halves)
        return Measured({measure: tuple(tuple(short(float(value)) for value in row) for row in np.atleast_2d(values))
                         for measure, values in lens_errors.items()})

    return records.get(f"{render.name}-{name}", facts, measure)


def times(settings: Settings, render: Render, name: str) -> Times | None:
    """Return the times of a render and a method; timed now if ``settings`` say so, None where they are not known.

    The second stage is timed on seed 0; of the render all seeds count.
    """
    records = Records(render.folders[0].parent / TIMES_FOLDER, StageTimes)
    facts = {"repeats": settings.repeats, **render.facts(name)}
    file = f"{render.name}-{name}"
    stage = records.read(file, facts)
    if stage is None and settings.times:
        with scratch_copy(render.folders[0]) as copy:
            stage = second_stage_times(copy, name, settings.repeats, warm=False)
        records.write(file, facts, stage)
    if stage is None:
        return None
    return Times(tuple(read_frame(folder).seconds["render"] for folder in render.folders), stage.second_stage_seconds,
                 stage.load_average)

