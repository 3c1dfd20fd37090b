"""The renders behind the comparison, with the processor seconds that each took.

All of one scene on one display are made in one Blender, which opens the scene once. What every render takes whatever
the panel's size is measured by a render of a few lenses and subtracted: on a small panel it would hide the rest. Of
the usual way FEW views are rendered one by one and their time is multiplied; for its image every view is cut out of a
render in one pass, which has the same rays. Processor seconds, since those of a clock say little on a machine that
does other things too. For Linux.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import shutil
from collections.abc import Sequence
from pathlib import Path

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.request import Request, Sampling
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.pipeline.store import is_complete
from lfsr_lab.experiments.displays.ways import EVERY_VIEW, GUIDES, SUBPIXEL, USUAL, Way, measured_at
from lfsr_lab.experiments.engine.records import Fingerprint, Records
from lfsr_lab.experiments.engine.renders import REFERENCE, Store, check_render, reference_of
from lfsr_lab.experiments.engine.timing import children_cpu_seconds

CPU_FOLDER = "cpu"
SINGLE = ("opening", "single")  # renders of a few lenses
FEW = 4


@dataclasses.dataclass(frozen=True)
class Cost:
    """What a render took."""

    cpu: float  # seconds on all cores, in a Blender that has the scene open, beyond those of a few lenses


@dataclasses.dataclass(frozen=True)
class Renders:
    """The renders of one scene on one kind of display."""

    store: Store
    scene: Path
    display: DisplayProfile
    reference_spp: int

    @property
    def folder(self) -> Path:
        """Where they are."""
        return self.store.folder / self.scene.stem / self.display.name

    @property
    def reference(self) -> Path:
        """Frame folder of the whole light field in two halves."""
        return self.folder / REFERENCE

    @property
    def traced_reference(self) -> Path | None:
        """Frame folder of the panel's subpixels in two halves; None where the panel has no lens sheet."""
        return self.folder / f"{REFERENCE}-{SUBPIXEL.folder}" if self.display.is_woven else None

    def path(self, way: Way, samples: int) -> Path:
        """Return the frame folder of a way's render; the usual way's has every view too."""
        return self.folder / f"{way.folder}-spp{samples}"

    def fill(self) -> dict[tuple[str, int], float]:
        """Render what is missing and return the CPU seconds of each render, by way and samples."""
        jobs = {(way.name, samples): self._job(way, samples) for way, samples in measured_at(self.display)}
        usual = [self._job(EVERY_VIEW, samples) for name, samples in jobs if name == USUAL.name]
        every = {job.output: job for job in (*jobs.values(), *usual, *self._references())}
        missing = [job for job in every.values() if self._cost(job) is None]
        if missing:
            self._render(missing)
        for job in every.values():
            check_render(job)
        return {key: self._whole(job) for key, job in jobs.items()}

    def _whole(self, job: Request) -> float:
        """Return the CPU seconds of a render; of the usual way those that all views would take."""
        cost = self._cost(job)
        if cost is None:
            raise LfsrError(f"what {job.output} took is not known: delete it and run this again")
        return cost.cpu * (math.prod(self.display.views) / math.prod(job.display.views))

    def _render(self, jobs: Sequence[Request]) -> None:
        """Render one after the other; first two of a few lenses: the first builds the scene, the second is measured."""
        lenses = tuple(itertools.product(range(4), range(4)))
        single = [dataclasses.replace(jobs[0], output=str(self.folder / name), sampling=Sampling(1, 1), kind="render",
                                      display=self.display, layout="one-pass", lens_list=lenses)
                  for name in SINGLE]
        seconds = [children_cpu_seconds()]

        def rendered(job: Request) -> None:
            seconds.append(children_cpu_seconds())
            if job not in single:
                cpu = seconds[-1] - seconds[-2] - (seconds[2] - seconds[1])
                self._costs.write(Path(job.output).name, _mark(job), Cost(max(0.0, cpu)))

        for job in (*single, *jobs):
            shutil.rmtree(job.output, ignore_errors=True)
        self.store.render_all([*single, *jobs], rendered)

    @property
    def _costs(self) -> Records[Cost]:
        return Records(self.folder / CPU_FOLDER, Cost)

    def _cost(self, job: Request) -> Cost | None:
        folder = Path(job.output)
        return self._costs.read(folder.name, _mark(job)) if is_complete(folder, job.kind) else None

    def _references(self) -> list[Request]:
        ways = [(EVERY_VIEW, self.reference), (SUBPIXEL, self.traced_reference)]
        return [reference_of(self._job(way, self.reference_spp), self.reference_spp, folder, scales=())
                for way, folder in ways if folder]

    def _job(self, way: Way, samples: int) -> Request:
        scales, one_by_one = way.scales(self.display), way == USUAL
        return Request(output=str(self.folder / f"few-views-spp{samples}" if one_by_one else self.path(way, samples)),
                   display=with_few_views(self.display) if one_by_one else self.display,
                   scene=str(self.scene.resolve()), sampling=Sampling(max(scales, default=1), samples, scales),
                   layers=GUIDES if way == EVERY_VIEW else (), layout=way.layout)


def with_few_views(profile: DisplayProfile) -> DisplayProfile:
    """Return the display with FEW views along each axis that has several."""
    px, py = (FEW if many else 1 for many in profile.parallax)
    pixels = profile.panel_pixels if profile.is_woven else (profile.lenses[0] * px, profile.lenses[1] * py)
    return dataclasses.replace(profile, views=(px, py), panel_pixels=pixels)


def _mark(job: Request) -> Fingerprint:
    return {"samples": job.sampling.samples, "scale": job.sampling.scale, "layout": job.layout}
