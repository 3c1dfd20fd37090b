"""Renders of a plan and its progress: quick look, pilot, reference and low-resolution renders of the sample."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lfsr_core.base.progress import Progress
from lfsr_core.frames.frame import REFERENCE_FILES, WORLD_FILE, Frame, read_frame
from lfsr_core.frames.request import Request, Sampling
from lfsr_core.pipeline.store import Render, cached
from lfsr_core.plan.sample import Lens
from lfsr_core.plan.times import path_samples

QUICK, QUICK_SCALE, QUICK_SAMPLES = "quick", 4, 4
PILOT_SAMPLES = 16
REFERENCE_PARTS = 2  # jobs of two independent halves each: four quarters
# Every render of the sample has random numbers of its own, other than those of reference halves (HALF_SEED).
SEED_STEP, REFERENCE_SEED, MOST_SCALE, MOST_SAMPLES = 7919, 1 << 23, 16, 4096


class Moving:
    """Progress of a plan in steps; the progress of a render moves that of the plan."""

    def __init__(self, progress: Progress) -> None:
        self._progress, self._message = progress, ""
        self._done, self._until, self._shown = 0.0, 0.0, 0.0

    def __call__(self, message: str, done: float, until: float | None = None) -> None:
        """Begin a step at the fraction ``done`` of the plan, which ends at ``until``."""
        self._message, self._done, self._until = message, done, done if until is None else until
        self._show(done, message)

    def rendering(self, _stage: str, fraction: float, message: str) -> None:
        """Show that the render of this step is at ``fraction``."""
        self._show(self._done + fraction * (self._until - self._done), f"{self._message}: {message}")

    def _show(self, fraction: float, message: str) -> None:
        self._shown = max(self._shown, min(fraction, 1.0))  # costs are guessed at first: never go back
        self._progress("plan", self._shown, message)


class SampleRenders:
    """Frame folders of the sample in ``folder``, each rendered with ``render`` when it is first needed."""

    def __init__(self, folder: Path, job: Request, render: Render) -> None:
        self._folder, self._job, self._render = folder, job, render
        self._frames: dict[str, Frame] = {}

    def quick(self) -> tuple[Path, Frame]:
        """Every lens, with few samples."""
        return self._rendered(QUICK, 1, sampling=Sampling(self._quick_scale, QUICK_SAMPLES))

    def pilot(self, lenses: Sequence[Lens]) -> Frame:
        """A few lenses at the scale of the quick look, with enough samples to time one."""
        return self._rendered("pilot", 2, sampling=Sampling(self._quick_scale, PILOT_SAMPLES),
                              lens_list=tuple(lenses))[1]

    def reference(self, look: int, part: int, spp: int, lenses: Sequence[Lens]) -> tuple[list[Path], Frame]:
        """Files of two quarters of the reference of a look's lenses; ``spp``: of all REFERENCE_PARTS together."""
        folder, frame = self._rendered(_of_look(f"reference-{part}", look), part + REFERENCE_PARTS * look,
                                       kind="reference", layers=(), clamp_indirect=0.0,
                                       sampling=Sampling(1, max(2, spp // REFERENCE_PARTS)), lens_list=tuple(lenses),
                                       seed=REFERENCE_SEED)
        return [folder / name for name in REFERENCE_FILES], frame

    def sampled(self, look: int, scale: int, spp: int, lenses: Sequence[Lens]) -> Path:
        """The lenses of a look and their neighbours at one scale and sample count."""
        return self._rendered(_of_look(f"s{scale}-spp{spp}", look), (look * MOST_SCALE + scale) * MOST_SAMPLES + spp,
                              sampling=Sampling(scale, spp), lens_list=tuple(lenses))[0]

    @property
    def of_lenses(self) -> list[Frame]:
        """Frames of the low-resolution renders of sampled lenses so far."""
        return [frame for name, frame in self._frames.items() if name == "pilot" or name.startswith("s")]

    @property
    def seconds(self) -> float:
        """Seconds of all renders so far, including loading the scene."""
        return sum(frame.seconds["open"] + frame.seconds["render"] for frame in self._frames.values())

    @property
    def samples(self) -> int:
        """Path samples of all renders so far."""
        return sum(path_samples(frame) for frame in self._frames.values())

    @property
    def _quick_scale(self) -> int:
        return min(self._job.display.scales() or [1], key=lambda scale: abs(scale - QUICK_SCALE))

    def _rendered(self, name: str, number: int, seed: int = 0, **changes: Any) -> tuple[Path, Frame]:
        """Folder of the job with ``changes``, rendered unless it is there; ``number`` decides its random numbers."""
        seed = (self._job.seed + seed + SEED_STEP * number) % 2**31
        folder = cached(dataclasses.replace(self._job, output=str(self._folder / name), seed=seed, world=self._world,
                                            **changes), self._render)
        self._frames[name] = read_frame(folder)
        return folder, self._frames[name]

    @property
    def _world(self) -> str | None:
        """File of the world, the same for all lenses and samples; None until it is rendered, or if it is not apart."""
        quick = self._frames.get(QUICK)
        return str(self._folder / QUICK / WORLD_FILE) if quick is not None and quick.world_apart else None


def _of_look(name: str, look: int) -> str:
    """Folder of a render of the first look, or of a later one."""
    return f"{name}-look{look + 1}" if look else name
