"""How near finished animations come to their references: each frame, and from frame to frame."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.frames.reference import Reference
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.metrics.split_ssim import mean_of
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.reconstruct.averaging import average_frames, near
from lfsr_core.reconstruct.second_stage import finished_lenses
from lfsr_lab.experiments.engine.accuracy import split_rms
from lfsr_lab.experiments.engine.measures import lens_ssims
from lfsr_lab.experiments.engine.timing import cpu_seconds


@dataclasses.dataclass(frozen=True)
class Figures:
    """Of one animation."""

    ssim: float  # mean split SSIM of elemental images
    flicker: float  # root mean square of how much more than the reference a pixel changes from frame to frame, percent
    offset: float  # the same of the errors of elemental images' means, percent
    lag: float  # frames by which elemental images' means are late; a wrong brightness counts too where light changes
    cpu_seconds: float  # of the second stage, per frame, of a few lenses finished and all denoised
    unseen: float | None = None  # split SSIM of lenses that a fitted network did not learn from, in older reports


@dataclasses.dataclass(frozen=True)
class Truth:
    """References of an animation."""

    lenses: Array  # (n, 2) rows and columns
    half_a: Array  # (frames, n, py, px, 3) display values, as half_b
    half_b: Array

    @classmethod
    def read(cls, folders: Sequence[Path]) -> Truth:
        """Read reference folders."""
        found = [Reference.read(folder) for folder in folders]
        halves = zip(*(reference.elemental_images() for reference in found), strict=True)
        return cls(found[0].lenses, *(np.stack(images) for images in halves))


def measure(lows: Sequence[LowResEIA], truth: Truth, method: str, reach: int) -> Figures:
    """Finish every frame, averaged with the 2 · ``reach`` nearest ones, and compare all with the references."""
    started, everywhere = cpu_seconds(), np.ones(len(truth.lenses), bool)
    images = []
    for number, low in enumerate(lows):
        others = [lows[other] for other in near(number, range(len(lows)), reach)]
        images.append(finished_lenses(average_frames(low, others)[0], everywhere, method, truth.lenses))
    seconds = (cpu_seconds() - started) / len(lows)
    return dataclasses.replace(compare(srgb_encode(np.stack(images)), truth), cpu_seconds=round(seconds, 3))


def compare(x: Array, truth: Truth) -> Figures:
    """Return the figures of display values ``x`` (frames, n, py, px, 3)."""
    a, b = truth.half_a, truth.half_b
    ssim = np.stack([lens_ssims(*images) for images in zip(x, a, b, strict=True)])
    steps = [np.diff(values, axis=0) for values in (x, a, b)]
    means = [values.mean((2, 3)) for values in (x, a, b)]
    return Figures(mean_of(ssim), 100 * split_rms(*steps), 100 * split_rms(*means), _lag(*means), cpu_seconds=0.0)


def _lag(x: Array, a: Array, b: Array) -> float:
    """Return the fraction of the way back to the frame before by which ``x`` is late."""
    back_a, back_b = (values[:-1] - values[1:] for values in (a, b))
    late = np.mean((x - a)[1:] * back_b + (x - b)[1:] * back_a, dtype=np.float64) / 2
    change = np.mean(back_a * back_b, dtype=np.float64)
    return float(late / change) if change > 0 else 0.0


def cost_of_averaging(display: DisplayProfile, scale: int) -> float:
    """Return the CPU seconds per neighbour of a frame, files not counted."""
    random, (sx, sy), (w, h) = np.random.default_rng(0), display.lenses, display.low_views(scale)

    def layer(channels: int) -> Array:
        return random.random((sy, sx, h, w, channels), dtype=np.float32)

    low, other = (LowResEIA(layer(3), layer(1), 16, scale) for _ in range(2))
    started = cpu_seconds()
    average_frames(low, [other])
    return cpu_seconds() - started
