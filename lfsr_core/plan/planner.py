"""Renders a sample of lenses and measures every candidate on it: the plan, step by step."""

from __future__ import annotations

import dataclasses
import json
import math
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json, write_json
from lfsr_core.frames.frame import REFERENCE_FILES, Frame, read_frame
from lfsr_core.frames.job import Job
from lfsr_core.plan import candidates
from lfsr_core.plan import sample as plan_sample
from lfsr_core.plan.candidates import Candidate, Choice, Rated
from lfsr_core.plan.estimate import Estimate, Stratum, estimate
from lfsr_core.plan.options import Options
from lfsr_core.plan.score import SampledReference, quick_look, score, stage_time
from lfsr_core.plan.times import TimeModel, path_samples
from lfsr_core.progress import Progress, silent
from lfsr_core.render.process import run_job
from lfsr_core.render.store import Render, kept

QUICK_SCALE, QUICK_SAMPLES = 4, 4
PILOT_LENSES, PILOT_SAMPLES = 64, 16
REFERENCE_PARTS = 2  # jobs of two independent halves each: four quarters
SAMPLE_FILE = "sample.json"
# Random numbers of one part of the sample are no other's and no reference half's (frame_folder.HALF_SEED).
SEED_STEP, REFERENCE_SEED, MOST_SAMPLES = 7919, 1 << 23, 4096


@dataclasses.dataclass(frozen=True)
class Planned:
    """A finished plan: ``rated`` candidates, the ``choice``, and ``sample``, JSON-ready facts on what was looked at."""

    rated: list[Rated]
    choice: Choice
    sample: dict[str, Any]


def make_plan(job: Job, options: Options, render: Render, folder: Path, progress: Progress = silent) -> Planned:
    """Plan for the scene, display and frame of ``job``; its scale, samples and output do not matter.

    ``render(job)`` renders one into its folder, all or nothing (``rendering``).
    ``folder`` keeps what was rendered: a second call goes on where one stopped.
    LfsrError for bad options, a scene without foreground, or what ``render`` raises.
    """
    wanted = options.candidates(job.display)
    if job.layout != "one-pass":
        raise LfsrError("a plan renders single lenses, which a view-by-view render cannot: choose the CPU or an "
                        "OptiX device, which trace all views in one pass")
    _check_sample(folder, job, options, wanted)
    return _Planner(job, options, wanted, _Renders(folder, job, render), progress).run()


@contextmanager
def work_folder(folder: Path | None) -> Iterator[Path]:
    """``folder``, or one that is thrown away after the block."""
    if folder is not None:
        yield folder
        return
    with tempfile.TemporaryDirectory(prefix="lfsr-plan-") as name:
        yield Path(name)


def rendering(blender: Any, warn: Callable[[str], None] | None = None) -> Render:
    """Renders with ``blender`` (blender_process.Blender) as its own process."""
    return lambda job: run_job(job, blender, None, warn)


def _check_sample(folder: Path, job: Job, options: Options, wanted: list[Candidate]) -> None:
    """LfsrError if ``folder`` holds the sample of another scene or setting, else its description is there."""
    same = {name: value for name, value in job.to_dict().items() if name not in ("output", "scale", "spp")}
    same |= {"lenses": options.lenses, "share": options.share, "reference_spp": options.reference_spp,
             "metric": options.metric, "renders": sorted({(c.scale, c.spp) for c in wanted})}
    same = json.loads(json.dumps(same))
    path = folder / SAMPLE_FILE
    if path.exists() and read_json(path, "the description of a sample") != same:
        raise LfsrError(f"{folder} holds the sample of another scene or of other options: choose another folder")
    write_json(path, same)


class _Renders:
    """Frame folders of the sample, rendered when first asked for."""

    def __init__(self, folder: Path, job: Job, render: Render) -> None:
        self._folder, self._job, self._render = folder, job, render
        self.frames: dict[str, Frame] = {}

    def __call__(self, name: str, number: int, **changes: Any) -> Path:
        """Folder of the job with ``changes``; ``number`` makes its random numbers its own."""
        seed = (self._job.seed + changes.pop("seed", 0) + SEED_STEP * number) % 2**31
        job = dataclasses.replace(self._job, output=str(self._folder / name), seed=seed, **changes)
        folder = kept(job, self._render)
        self.frames[name] = read_frame(folder)
        return folder

    @property
    def seconds(self) -> float:
        """Of all renders so far, loading the scene included."""
        return sum(sum(frame.seconds.values()) for frame in self.frames.values())

    @property
    def samples(self) -> int:
        """Path samples of all renders so far."""
        return sum(path_samples(frame) for frame in self.frames.values())


class _Planner:
    """One run of ``make_plan``; every method is a step of it."""

    def __init__(self, job: Job, options: Options, wanted: list[Candidate], renders: _Renders,
                 progress: Progress) -> None:
        self.job, self.options, self.wanted, self.renders, self.progress = job, options, wanted, renders, progress
        self.display, self.scores, self.notes = job.display, {}, {}
        self.budget: plan_sample.Budget | None = None
        self.lenses: list[plan_sample.Lens] = []
        self.measured: list[tuple[int, int]] = []
        self.work_seconds = 0.0

    def run(self) -> Planned:
        """All steps."""
        self._look()
        self._choose_lenses()
        self.reference = self._reference()
        for scale in sorted({candidate.scale for candidate in self.wanted}, reverse=True):
            self._measure_scale(scale)
        rated = self.rated()
        return Planned(rated, candidates.choose(rated, self.options.target, self.options.most_seconds), self._facts())

    def _look(self) -> None:
        """A quick render of every lens: the foreground, its covariates, and what a frame costs."""
        scale = self._quick_scale
        self._tell("looking at every lens")
        self.quick = quick_look(self.renders("quick", 1, scale=scale, spp=QUICK_SAMPLES))
        if not self.quick.masks["foreground"].any():
            raise LfsrError("no lens shows any foreground: check where the camera looks, and --subject")
        frame, finish = self.renders.frames["quick"], self.quick.finish
        whole = candidates.low_pixels(self.display, scale)
        self.times = TimeModel(frame.seconds["open"], 0.0, frame.seconds["render"] / path_samples(frame),
                               finish["load"] / whole, sum(finish.values()) - finish["load"],
                               int(self.quick.masks["foreground"].sum()), self.quick.shown)

    def _dearness(self) -> float:
        """How much more a sample costs in a foreground lens than in the mean lens, from a few of them."""
        self._tell("what the foreground costs")
        mask = self.quick.masks["foreground"]
        few = plan_sample.sample({**self.quick.masks, "edge": np.zeros_like(mask)}, PILOT_LENSES, self.job.seed, False)
        self.renders("pilot", 2, scale=self._quick_scale, spp=PILOT_SAMPLES,
                     lens_list=tuple(few["foreground"]))
        pilot = self.renders.frames["pilot"]
        ratio = pilot.seconds["render"] / path_samples(pilot) / self.times.per_sample
        # Where the others cost nothing it is the inverse of the foreground's share; set-up can only add to that.
        return float(np.clip(ratio, 1, mask.size / mask.sum()))

    @property
    def _quick_scale(self) -> int:
        return min(self.display.scales() or [1], key=lambda scale: abs(scale - QUICK_SCALE))

    def _choose_lenses(self) -> None:
        quick = path_samples(self.renders.frames["quick"])
        self.budget = plan_sample.budget(self.display, self.wanted, self.options.reference_spp, quick,
                                         self._dearness(), self.options.share)
        count = self.options.lenses or self.budget.lenses
        self.strata = plan_sample.sample(self.quick.masks, count, self.job.seed, self.options.metric == "ssim_eia")
        self.lenses = [lens for name in plan_sample.STRATA for lens in self.strata[name]]
        # Fewer lenses would tell nothing, and a number that was asked for is taken: then there is no limit.
        self.bound = math.inf if self.options.lenses or count <= plan_sample.LEAST_LENSES else self.budget.allowed

    def _reference(self) -> SampledReference:
        """The sampled lenses at full resolution, in four independent quarters."""
        halves = []
        for part in range(REFERENCE_PARTS):
            self._tell(f"reference of {len(self.lenses)} lenses, part {part + 1} of {REFERENCE_PARTS}")
            spp = max(2, self.options.reference_spp // REFERENCE_PARTS)
            folder = self.renders(f"reference-{part}", part, kind="reference", scale=1, spp=spp,
                                  layers=(), clamp_indirect=0.0, lens_list=tuple(self.lenses), seed=REFERENCE_SEED)
            halves += [folder / name for name in REFERENCE_FILES]
        return SampledReference.read(halves, self.renders.frames["reference-0"], len(self.lenses))

    def _measure_scale(self, scale: int) -> None:
        """Every candidate of ``scale`` that could be the cheapest, and the next more samples, which confirm it."""
        for spp in sorted({c.spp for c in self.wanted if c.scale == scale}):
            here = [c for c in self.wanted if (c.scale, c.spp) == (scale, spp)]
            why = self._why_not(here)
            if why:
                self.notes |= dict.fromkeys(here, why)
            else:
                self._measure(scale, spp, here)

    def _why_not(self, here: list[Candidate]) -> str:
        """Reason to leave these candidates of one scale and sample count out, empty if there is none."""
        scale, spp = here[0].scale, here[0].spp
        least = min(self._times().seconds(candidate, self.display) for candidate in here)
        if least > self.options.most_seconds:
            return "takes too long"
        chosen = candidates.choose(self.rated(), self.options.target, self.options.most_seconds).chosen
        confirms = chosen and chosen.candidate.scale == scale and all(
            spp <= other for key, other in self.budget.renders if key == scale and other > chosen.candidate.spp)
        if chosen and least > chosen.seconds and not confirms:
            return f"not needed: dearer than {chosen.candidate.name}"
        if self.budget.cost(len(self.lenses), [*self.measured, (scale, spp)]) > self.bound:
            return "not measured: beyond the sample's budget (--budget)"
        return ""

    def _measure(self, scale: int, spp: int, here: list[Candidate]) -> None:
        reach = plan_sample.reach(self.display, scale)
        listed, blocks = plan_sample.with_neighbours(self.lenses, reach, self.display.lenses)
        self._tell(f"{len(listed)} lenses at scale {scale}, {spp} samples")
        folder = self.renders(f"s{scale}-spp{spp}", scale * MOST_SAMPLES + spp, scale=scale,
                              spp=spp, lens_list=tuple(listed))
        self.measured.append((scale, spp))
        started = time.perf_counter()
        for candidate in here:
            self._tell(candidate.name)
            self._score(candidate, folder, plan_sample.Mosaic.of(blocks), plan_sample.Mosaic.of(blocks[:1]))
        self.work_seconds += time.perf_counter() - started

    def _score(self, candidate: Candidate, folder: Path, mosaic: plan_sample.Mosaic, one: plan_sample.Mosaic) -> None:
        try:
            self.scores[candidate] = score(folder, candidate.method, mosaic, self.reference)
            stage = stage_time(folder, candidate.method, mosaic, one)
        except LfsrError as error:
            self.notes[candidate] = str(error)
            return
        self.times.stages[candidate.scale, candidate.method] = stage

    def rated(self) -> list[Rated]:
        """What is known by now, cheapest first."""
        times = self._times()
        rows = [Rated(candidate, times.seconds(candidate, self.display),
                      self._estimate(self.scores[candidate].values) if candidate in self.scores else None,
                      self.notes.get(candidate, "")) for candidate in self.wanted]
        rows += [Rated(candidate, times.seconds(candidate, self.display), self._estimate(values), candidates.BETWEEN)
                 for candidate, values in self._between()]
        return sorted(rows, key=lambda row: row.seconds)

    def _between(self) -> Iterator[tuple[Candidate, np.ndarray]]:
        """Candidates between measured ones, and the accuracy (n,) of each lens there."""
        for scale, method in sorted({(candidate.scale, candidate.method) for candidate in self.scores}):
            known = {candidate.spp: scores.values for candidate, scores in self.scores.items()
                     if (candidate.scale, candidate.method) == (scale, method)}
            for spp, fewer, more, weight in candidates.between(list(known), self.options.between):
                yield Candidate(scale, spp, method), (1 - weight) * known[fewer] + weight * known[more]

    def _estimate(self, of_lenses: np.ndarray) -> Estimate:
        """Mean over the display from the accuracy (n,) of every sampled lens."""
        whole, strata, start = self.options.metric == "ssim_eia", [], 0
        for name in plan_sample.STRATA:
            rows = slice(start, start + len(self.strata[name]))
            start = rows.stop
            if name == "rest" and not whole:
                continue
            values = of_lenses[rows]
            inside = np.ones(len(values), bool) if whole or name == "foreground" else self.reference.hits[rows]
            strata.append(Stratum(int(self.quick.masks[name].sum()), values, inside,
                                  *self.quick.covariates(name, self.strata[name])))
        return estimate(strata)

    def _times(self) -> TimeModel:
        frames = self.renders.frames
        sampled = [frame for name, frame in frames.items() if name == "pilot" or name.startswith("s")]
        return self.times.refined(frames["quick"], sampled, float(self.quick.masks["foreground"].mean()))

    def _facts(self) -> dict[str, Any]:
        dearest = max(self.wanted, key=lambda candidate: candidates.samples_of(candidate, self.display))
        times = self._times()
        gains = [scores.gain for scores in self.scores.values()]
        return {"lenses": {name: len(lenses) for name, lenses in self.strata.items()},
                "foreground": self.times.foreground, "dearest": dearest.name,
                "dearest_seconds": times.seconds(dearest, self.display), "seconds": self.renders.seconds,
                "measuring_seconds": self.work_seconds,
                "share": self.renders.samples / candidates.samples_of(dearest, self.display),
                "share_of_seconds": self.renders.seconds / times.seconds(dearest, self.display),
                "dearness": self.budget.dearness, "within_budget": math.isfinite(self.bound),
                "reference_noise": self.reference.noise, "largest_gain": max(gains, default=0.0)}

    def _tell(self, message: str) -> None:
        """Progress by what the sample costs; before that is known, none."""
        if self.budget is None:
            self.progress("plan", 0.0, message)
            return
        whole = self.budget.cost(len(self.lenses), self.budget.renders)
        self.progress("plan", self.budget.cost(len(self.lenses), self.measured) / whole, message)
