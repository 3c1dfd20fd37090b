"""The cells of a chart: renders of all seeds, each finished by every method and measured; and their times."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lfsr_core.frames.frame import read_frame
from lfsr_core.frames.reference import check_reference
from lfsr_core.frames.request import Request, Sampling
from lfsr_lab.experiments.chart.analysis import short
from lfsr_lab.experiments.chart.records import DIRECT, LOW, Measured, Role, Times
from lfsr_lab.experiments.chart.settings import Settings
from lfsr_lab.experiments.engine.measures import VERSION, errors
from lfsr_lab.experiments.engine.records import Fingerprint, Records, method_facts
from lfsr_lab.experiments.engine.renders import frame_digest
from lfsr_lab.experiments.engine.timing import StageTimes, known_seconds, scratch_copy, second_stage_times
from lfsr_lab.experiments.engine.truth import Truth

CELL_FOLDER, TIMES_FOLDER = "cells", "times"


@dataclasses.dataclass(frozen=True)
class Render:
    """A render of a scene with all its seeds."""

    role: Role
    jobs: tuple[Request, ...]  # one per seed, that of seed 0 first

    @property
    def folders(self) -> list[Path]:
        """Folder of each seed."""
        return [Path(job.output) for job in self.jobs]

    @property
    def name(self) -> str:
        """Name in records."""
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
    """Return one render of a scene."""
    name = f"s{scale}-spp{samples}" + (f"-seed{seed}" if seed else "")
    return Request(output=str(settings.folder / scene.stem / name), display=settings.profile,
                   scene=str(scene.resolve()),
               sampling=Sampling(scale, samples), device=settings.device, seed=seed,
               subject=settings.subject, world_visible=settings.world_visible)


def measured(render: Render, name: str, truth: Truth) -> Measured:
    """Return the values of a render and a method, measured unless they are stored and still fit.

    LfsrError where the reference is not of the render, or where the method cannot finish it.
    """
    records = Records(render.folders[0].parent / CELL_FOLDER, Measured)
    facts = {"version": VERSION, "reference": frame_digest(truth.folder), **render.facts(name)}
    return records.get(f"{render.name}-{name}", facts, lambda: _measure(render, name, truth))


def _measure(render: Render, name: str, truth: Truth) -> Measured:
    for folder in render.folders:
        check_reference(read_frame(folder), truth.reference.frame)
    images = np.array([truth.finished(folder, name) for folder in render.folders])
    found = errors(images, *truth.halves)
    return Measured({measure: tuple(tuple(short(float(value)) for value in row) for row in np.atleast_2d(values))
                     for measure, values in found.items()})


def times(settings: Settings, render: Render, name: str) -> Times | None:
    """Return the times of a render and a method; timed now if ``settings`` say so, None where they are not known.

    The second stage is timed on seed 0. The render counts as often as it was repeated, else with all its seeds.
    """
    records = Records(render.folders[0].parent / TIMES_FOLDER, StageTimes)
    facts = {"repeats": settings.repeats, "render_repeats": settings.render_repeats, **render.facts(name)}
    file = f"{render.name}-{name}"
    stage = records.read(file, facts)
    if stage is None and settings.times:
        with scratch_copy(render.folders[0]) as copy:
            stage = second_stage_times(copy, name, settings.repeats, warm=False)
        records.write(file, facts, stage)
    if stage is None:
        return None
    return Times(render_seconds(settings, render), stage.second_stage_seconds, stage.load_average)


def render_seconds(settings: Settings, render: Render) -> tuple[float, ...]:
    """Return the seconds of every run of a render that counts."""
    if settings.render_repeats:
        return tuple(known_seconds(render.folders[0]))
    return tuple(read_frame(folder).seconds["render"] for folder in render.folders)
