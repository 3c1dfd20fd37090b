"""The renders behind the comparison, with the processor seconds that each took; those that are there are kept.

All of one scene on one display are made in one Blender, which opens the scene once. What any render then takes, and
the panel's size does not change, is measured by one of a few lenses and taken off: on a panel of few pixels it would
hide the rest. Of the usual way FEW views are rendered one by one and their time is multiplied; for its picture every
view is cut out of a render in one pass, which has the same rays. Processor seconds, since those of a clock say little
on a machine that does other things too. For Linux.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import os
import resource
import shutil
from collections.abc import Sequence
from pathlib import Path

from lfsr_core.frames.identity import check_same
from lfsr_core.frames.job import Job
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.progress import ProgressBar
from lfsr_core.render.blender import find_blender
from lfsr_core.render.process import Listener, run_jobs
from lfsr_core.render.store import is_complete
from lfsr_lab.experiments.cells import Cells, Fingerprint
from lfsr_lab.experiments.displays.kinds import Kind
from lfsr_lab.experiments.displays.ways import DIRECT, OTHER, OURS, STRAIGHT, USUAL, WAYS, Way, measured_at

CPU_FOLDER, REFERENCE = "cpu", "reference"
SINGLE = ("opening", "single")  # renders of a few lenses
FEW = 4
DIRECT_WAY, STRAIGHT_WAY = (next(way for way in WAYS if way.name == name) for name in (DIRECT, STRAIGHT))
LAYERS = ("albedo", "normal")


@dataclasses.dataclass(frozen=True)
class Cost:
    """What a render took."""

    cpu: float  # seconds on all cores, in a Blender that has the scene open, beyond those of a few lenses
    fixed: float  # those of a few lenses


@dataclasses.dataclass(frozen=True)
class Shelf:
    """Where the renders of one scene on one kind of display lie."""

    folder: Path
    scene: Path
    kind: Kind
    reference_spp: int
    blender: str | None = None  # executable used instead of the one found

    @property
    def reference(self) -> Path:
        """Frame folder of the whole light field in two halves."""
        return self.folder / REFERENCE

    @property
    def straight_reference(self) -> Path | None:
        """Frame folder of the panel's subpixels in two halves; None where the panel has no lens sheet."""
        return self.folder / f"{REFERENCE}-{STRAIGHT}" if self.kind.profile.is_woven else None

    def path(self, way: Way, samples: int) -> Path:
        """Frame folder of a way's render."""
        name = {OURS: "ours", OTHER: "ours-other", STRAIGHT: "straight"}.get(way.name, "every-view")
        return self.folder / f"{name}-spp{samples}"

    def fill(self) -> dict[tuple[str, int], Cost]:
        """Make what is not there; what each render took, by way and samples."""
        jobs = {(way.name, samples): self._job(way, samples) for way, samples in measured_at(self.kind.profile)}
        every = {job.output: job for job in (*jobs.values(), *self._usual_pictures(), *self._references())}
        missing = [job for job in every.values() if self._cost(job) is None]
        if missing:
            self._render(missing)
        for job in every.values():
            check_same(Path(job.output), job)
        return {key: self._whole(job) for key, job in jobs.items()}

    def _whole(self, job: Job) -> Cost:
        """What a render took; of the usual way what all views would take."""
        cost = self._cost(job)
        share = math.prod(self.kind.profile.views) / math.prod(job.display.views)
        return dataclasses.replace(cost, cpu=cost.cpu * share)

    def _render(self, jobs: Sequence[Job]) -> None:
        """One after the other; first two of a few lenses: the scene is built for one, the other says what any takes."""
        lenses = tuple(itertools.product(range(4), range(4)))
        single = [dataclasses.replace(jobs[0], output=str(self.folder / name), scale=1, scales=(), spp=1, kind="render",
                                      display=self.kind.profile, layout="one-pass", lens_list=lenses)
                  for name in SINGLE]
        bar, seconds = ProgressBar(), [_children()]

        def rendered(job: Job) -> None:
            seconds.append(_children())
            if job not in single:
                fixed = seconds[2] - seconds[1]
                cost = Cost(max(0.0, seconds[-1] - seconds[-2] - fixed), fixed)
                self._cells.write(Path(job.output).name, _mark(job), cost)

        for job in (*single, *jobs):
            shutil.rmtree(job.output, ignore_errors=True)
        try:
            run_jobs([*single, *jobs], find_blender(self.blender), Listener(bar, bar.note, rendered))
        finally:
            bar.close()

    @property
    def _cells(self) -> Cells[Cost]:
        return Cells(self.folder / CPU_FOLDER, Cost)

    def _cost(self, job: Job) -> Cost | None:
        folder = Path(job.output)
        return self._cells.read(folder.name, _mark(job)) if is_complete(folder, job.kind) else None

    def _references(self) -> list[Job]:
        ways = [(DIRECT_WAY, self.reference), (STRAIGHT_WAY, self.straight_reference)]
        return [dataclasses.replace(self._job(way, self.reference_spp), output=str(folder), kind="reference",
                                    clamp_indirect=0.0, layers=()) for way, folder in ways if folder]

    def _usual_pictures(self) -> list[Job]:
        return [self._job(DIRECT_WAY, samples) for way, samples in measured_at(self.kind.profile) if way.name == USUAL]

    def _job(self, way: Way, samples: int) -> Job:
        scales, one_by_one = way.scales(self.kind.profile), way.name == USUAL
        return Job(output=str(self.folder / f"few-views-spp{samples}" if one_by_one else self.path(way, samples)),
                   display=with_few_views(self.kind.profile) if one_by_one else self.kind.profile,
                   scene=str(self.scene.resolve()), scale=max(scales, default=1), scales=scales, spp=samples,
                   layers=() if way.name in (USUAL, STRAIGHT) else LAYERS, layout=way.layout)


def with_few_views(profile: DisplayProfile) -> DisplayProfile:
    """The display with FEW views along each axis that has several."""
    views = tuple(FEW if many else 1 for many in profile.parallax)
    pixels = tuple(lenses * count for lenses, count in zip(profile.lenses, views, strict=True))
    return dataclasses.replace(profile, views=views, panel_pixels=profile.panel_pixels if profile.is_woven else pixels)


def _mark(job: Job) -> Fingerprint:
    return {"samples": job.spp, "scale": job.scale, "layout": job.layout}


def _children() -> float:
    """Processor seconds of this process's children so far, those that still run too."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime + sum(map(_seconds, Path("/proc").glob("[0-9]*/stat")))


def _seconds(stat: Path) -> float:
    """Of a process of /proc that is a child of this one, else 0."""
    try:
        fields = stat.read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
    except OSError:  # it has ended
        return 0.0
    parent, user, system = int(fields[1]), int(fields[11]), int(fields[12])
    return (user + system) / os.sysconf("SC_CLK_TCK") if parent == os.getpid() else 0.0
