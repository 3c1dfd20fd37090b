"""Figures of one animation, finished in one way: split SSIM, flicker and drift against its references per frame.

Images are display values (frames, lenses, py, px, 3); halves a and b of the references have independent noise, so that
products of errors against one and the other have none.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.frames.reference import Reference
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.metrics.split_ssim import mean_of
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.reconstruct.methods.temporal_averaging import average_frames, similarity
from lfsr_core.reconstruct.neighbours import near
from lfsr_core.reconstruct.registry import Method
from lfsr_core.reconstruct.second_stage import finished_lenses
from lfsr_lab.experiments.engine.accuracy import lens_ssims, split_rms
from lfsr_lab.experiments.engine.timing import cpu_seconds

BEFORE, AFTER = "before", "after"  # the denoiser


@dataclasses.dataclass(frozen=True)
class Window:
    """Which frames are averaged, and how."""

    past: int = 0
    future: int = 0
    whole: bool = False  # True: at the ends of the animation more from the other side make up for those that lack
    tested: bool = True  # False: whether or not they show the same
    where: str = BEFORE  # before the denoiser, or the finished images


@dataclasses.dataclass(frozen=True)
class Figures:
    """Of one animation."""

    ssim: float  # mean split SSIM of elemental images
    unseen: float  # the same of the lenses from which `lfsr fit` does not learn
    flicker: float  # root mean square of how much more than the reference a pixel changes from frame to frame, percent
    offset: float  # the same of the errors of elemental images' means, percent
    lag: float  # frames by which elemental images' means are late; a wrong brightness counts too where light changes
    cpu_seconds: float  # of the second stage, per frame, of a few lenses finished and all denoised


@dataclasses.dataclass(frozen=True)
class Truth:
    """References of an animation."""

    lenses: Array  # (n, 2) rows and columns
    half_a: Array  # (frames, n, py, px, 3) display values, as half_b
    half_b: Array

    @classmethod
    def read(cls, folders: Sequence[Path]) -> Truth:
        """From reference folders."""
        found = [Reference.read(folder) for folder in folders]
        halves = zip(*(reference.elemental_images() for reference in found), strict=True)
        return cls(found[0].lenses, *(np.stack(images) for images in halves))


def measure(lows: Sequence[LowResEIA], truth: Truth, methods: Sequence[Method], window: Window,
            unseen: Array) -> Figures:
    """Finish every frame, by the method of its place in ``methods``; ``unseen``: numbers of lenses."""
    started = cpu_seconds()
    averaged = [_averaged(lows, number, window) for number in range(len(lows))]
    everywhere = np.ones(len(truth.lenses), bool)
    images = [finished_lenses(low, everywhere, method, truth.lenses)
              for low, method in zip(averaged, methods, strict=True)]
    if window.where == AFTER:
        images = [_mean_of_finished(lows, images, number, window, truth) for number in range(len(lows))]
    seconds = (cpu_seconds() - started) / len(lows)
    values = srgb_encode(np.stack(images))
    return dataclasses.replace(compare(values, truth, unseen), cpu_seconds=round(seconds, 3))


def compare(x: Array, truth: Truth, unseen: Array) -> Figures:
    """Figures of display values ``x`` (frames, n, py, px, 3)."""
    a, b = truth.half_a, truth.half_b
    ssim = np.stack([lens_ssims(*images) for images in zip(x, a, b, strict=True)])
    steps = [np.diff(values, axis=0) for values in (x, a, b)]
    means = [values.mean((2, 3)) for values in (x, a, b)]
    return Figures(mean_of(ssim), mean_of(ssim[:, unseen]), flicker=100 * split_rms(*steps),
                   offset=100 * split_rms(*means), lag=_lag(*means), cpu_seconds=0.0)


def _lag(x: Array, a: Array, b: Array) -> float:
    """By how much of the way back to the frame before ``x`` is off: its errors on the references' changes."""
    back_a, back_b = (values[:-1] - values[1:] for values in (a, b))
    late = np.mean((x - a)[1:] * back_b + (x - b)[1:] * back_a, dtype=np.float64) / 2
    change = np.mean(back_a * back_b, dtype=np.float64)
    return float(late / change) if change > 0 else 0.0


def neighbours(number: int, count: int, window: Window) -> list[int]:
    """Numbers of the other frames in the window of frame ``number``."""
    if window.whole:
        return list(near(number, range(count), window.past))
    around = range(max(0, number - window.past), min(count, number + window.future + 1))
    return [other for other in around if other != number]


def _averaged(lows: Sequence[LowResEIA], number: int, window: Window) -> LowResEIA:
    low, others = lows[number], [lows[other] for other in neighbours(number, len(lows), window)]
    if window.where == AFTER or not others:
        return low
    if window.tested:
        return average_frames(low, others)
    return dataclasses.replace(low, color=np.mean([low.color, *(other.color for other in others)], axis=0))


def _mean_of_finished(lows: Sequence[LowResEIA], images: Sequence[Array], number: int, window: Window,
                      truth: Truth) -> Array:
    """Finished images averaged by the weights that the rendered ones would have."""
    total, count = images[number].astype(np.float32), 1.0
    rows, columns = truth.lenses.T
    scale = images[number].shape[1] // lows[number].color.shape[2]
    for other in neighbours(number, len(lows), window):
        weight = similarity(lows[number], lows[other])[rows, columns].repeat(scale, 1).repeat(scale, 2)[..., None]
        total, count = total + weight * images[other], count + weight
    return total / count


def cost_of_averaging(display: DisplayProfile, scale: int) -> float:
    """CPU seconds per neighbour of a frame with albedo and normal, files not counted."""
    random, (sx, sy), (w, h) = np.random.default_rng(0), display.lenses, display.low_views(scale)

    def layer(channels: int) -> Array:
        return random.random((sy, sx, h, w, channels), dtype=np.float32)

    low, other = (LowResEIA(layer(3), layer(1), 16, scale, layer(3), layer(3)) for _ in range(2))
    started = cpu_seconds()
    average_frames(low, [other])
    return cpu_seconds() - started
