"""The renders behind a plan: a quick look, a pilot, the reference of the sampled lenses, and their renders."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lfsr_core.frames.frame import REFERENCE_FILES, WORLD_FILE, Frame, read_frame
from lfsr_core.frames.job import Job
from lfsr_core.plan.moving import Moving
from lfsr_core.plan.sample import Lens
from lfsr_core.plan.times import path_samples
from lfsr_core.render.blender import Blender
from lfsr_core.render.process import Warn, run_job
from lfsr_core.render.store import Render, cached

QUICK, QUICK_SCALE, QUICK_SAMPLES = "quick", 4, 4
PILOT_SAMPLES = 16
REFERENCE_PARTS = 2  # jobs of two independent halves each: four quarters
# Random numbers of one part of the sample are no other's and no reference half's (the add-on's HALF_SEED).
SEED_STEP, REFERENCE_SEED, MOST_SAMPLES = 7919, 1 << 23, 4096


def rendering(blender: Blender, warn: Warn | None = None, moving: Moving | None = None) -> Render:
    """Renders with ``blender`` as its own process.

    ``warn(sentence)`` of what the user should know; ``moving`` is told how far each render is.
    """
    return lambda job: run_job(job, blender, moving and moving.rendering, warn)


class SampleRenders:
    """Frame folders of the sample inside ``folder``, rendered with ``render`` when first asked for."""

    def __init__(self, folder: Path, job: Job, render: Render) -> None:
        self._folder, self._job, self._render = folder, job, render
        self._frames: dict[str, Frame] = {}

    def quick(self) -> tuple[Path, Frame]:
        """Every lens with few samples."""
        return self._kept(QUICK, 1, scale=self._quick_scale, spp=QUICK_SAMPLES)

    def pilot(self, lenses: Sequence[Lens]) -> Frame:
        """A few lenses, as the quick look shows them, with enough samples to say what one costs."""
        return self._kept("pilot", 2, scale=self._quick_scale, spp=PILOT_SAMPLES, lens_list=tuple(lenses))[1]

    def reference(self, part: int, spp: int, lenses: Sequence[Lens]) -> tuple[list[Path], Frame]:
        """Files of two quarters of the sampled lenses' reference, ``spp`` samples in each part of REFERENCE_PARTS."""
        folder, frame = self._kept(f"reference-{part}", part, kind="reference", scale=1, layers=(), clamp_indirect=0.0,
                                   spp=max(2, spp // REFERENCE_PARTS), lens_list=tuple(lenses), seed=REFERENCE_SEED)
        return [folder / name for name in REFERENCE_FILES], frame

    def sampled(self, scale: int, spp: int, lenses: Sequence[Lens]) -> Path:
        """The sampled lenses and their neighbours at one scale and number of samples."""
        return self._kept(f"s{scale}-spp{spp}", scale * MOST_SAMPLES + spp, scale=scale, spp=spp,
                          lens_list=tuple(lenses))[0]

    @property
    def of_lenses(self) -> list[Frame]:
        """Frames of the low-resolution renders of some lenses, so far."""
        return [frame for name, frame in self._frames.items() if name == "pilot" or name.startswith("s")]

    @property
    def seconds(self) -> float:
        """Of all renders so far, loading the scene included."""
        return sum(frame.seconds["open"] + frame.seconds["render"] for frame in self._frames.values())

    @property
    def samples(self) -> int:
        """Path samples of all renders so far."""
        return sum(path_samples(frame) for frame in self._frames.values())

    @property
    def _quick_scale(self) -> int:
        return min(self._job.display.scales() or [1], key=lambda scale: abs(scale - QUICK_SCALE))

    def _kept(self, name: str, number: int, seed: int = 0, **changes: Any) -> tuple[Path, Frame]:
        """Folder of the job with ``changes``; ``number`` makes its random numbers its own."""
        seed = (self._job.seed + seed + SEED_STEP * number) % 2**31
        folder = cached(dataclasses.replace(self._job, output=str(self._folder / name), seed=seed, world=self._world,
                                            **changes), self._render)
        self._frames[name] = read_frame(folder)
        return folder, self._frames[name]

    @property
    def _world(self) -> str | None:
        """The world behind everything, which neither lenses nor samples change; None until it is rendered."""
        quick = self._frames.get(QUICK)
        return str(self._folder / QUICK / WORLD_FILE) if quick is not None and quick.world_apart else None
