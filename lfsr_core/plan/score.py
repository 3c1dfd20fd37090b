"""Accuracy and time of a method on sampled lenses."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.cores import usable_cores
from lfsr_core.frames.foreground import foreground_mask
from lfsr_core.frames.frame import LOW_RES_FILE, Frame, read_frame
from lfsr_core.frames.low_res import LowResEIA, low_resolution, read_world
from lfsr_core.frames.reference import listed_images, read_half
from lfsr_core.images.exr import read_finite
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.metrics.split_ssim import stacked_ssim
from lfsr_core.pipeline.finishing import finish_frame
from lfsr_core.plan.sample import Lens, Mosaic, strata_masks
from lfsr_core.plan.times import StageTime
from lfsr_core.reconstruct.assembly import MAX_WORKERS, finish_lenses
from lfsr_core.reconstruct.methods import METHODS, load_method
from lfsr_core.reconstruct.methods.denoise import denoise_low_resolution, is_available, shown_part
from lfsr_core.reconstruct.methods.epipolar import Recovering
from lfsr_core.reconstruct.second_stage import FILL_METHOD, finished_lenses

CORRECTED = 0.5  # fraction of the loss by the reference's remaining noise that is added to the metric
LENSES_TIMED = 1024
FINISHING = ("load", "mask", "assemble", "color", "write")


@dataclasses.dataclass(frozen=True)
class QuickLook:
    """What a render of every lens with few samples shows."""

    masks: dict[str, Array]  # (sy, sx) bool by name of the stratum, see sample.strata_masks
    features: Array  # (sy, sx, k), see the function ``features``
    finish: dict[str, float]  # seconds of the second stage's steps that are the same for every method
    shown: float  # fraction of the frame that is denoised
    world: float = 0.0  # seconds of the lenses that show only a world that was rendered apart

    def covariates(self, name: str, lenses: Sequence[Lens]) -> tuple[Array | None, Array | None]:
        """Covariates (n, k) of sampled foreground lenses, and their means over the foreground; else (None, None)."""
        if name != "foreground" or not lenses:
            return None, None
        rows, columns = np.asarray(lenses).T
        return self.features[rows, columns], self.features[self.masks[name]].mean(0)


@dataclasses.dataclass(frozen=True)
class SampledReference:
    """The sampled lenses' reference."""

    quarters: tuple[Array, ...]  # four independent renders (n, py, px, 3), scene-linear
    hits: Array  # (n,) bool, lenses with any foreground
    noise: float  # standard deviation of the mean of two quarters, a half, in sRGB values

    @classmethod
    def read(cls, paths: Sequence[Path], frame: Frame, count: int) -> SampledReference:
        """Read the EXR files of the quarters; ``frame`` describes all of them."""
        images, hits = zip(*(read_half(path, frame) for path in paths), strict=True)
        quarters = tuple(listed_images(image, frame)[:count] for image in images)
        shown = [srgb_encode((quarters[i] + quarters[i + 1]) / 2) for i in (0, 2)]
        noise = float(np.sqrt(np.mean((shown[0] - shown[1]) ** 2, dtype=np.float64) / 2))
        return cls(quarters, np.any(hits, 0).reshape(-1)[:count], noise)

    def pair(self, first: Sequence[int], second: Sequence[int]) -> tuple[Array, Array]:
        """Two halves in sRGB values, each of the mean of the numbered quarters."""
        half_a, half_b = (srgb_encode(np.mean([self.quarters[n] for n in half], 0)) for half in (first, second))
        return half_a, half_b


@dataclasses.dataclass(frozen=True)
class Scores:
    """Accuracy of a method on sampled lenses."""

    # (n,) split SSIM of each lens, against halves of two of the reference's quarters and of one
    full: Array
    less: Array

    @property
    def gain(self) -> float:
        """Gain of the mean with twice the reference's samples."""
        return float(np.mean(self.full - self.less))

    @property
    def values(self) -> Array:
        """Split SSIM (n,) of each lens, corrected for the reference's noise.

        That noise lowers the metric about in proportion to its variance. So what the metric gains from halves of one
        quarter to halves of two is missing once more. CORRECTED of that gain is added: adding all of it would
        sometimes promise too much (docs/notebook/plan.md).
        """
        # Strong noise, whose variances are cut off at 0, raises the metric: then there is no gain to extrapolate.
        return self.full + CORRECTED * (self.full - self.less) if self.gain > 0 else self.full

    def __add__(self, more: Scores) -> Scores:
        """The same method's accuracy on these lenses and on ``more``."""
        return Scores(np.concatenate([self.full, more.full]), np.concatenate([self.less, more.less]))


def quick_look(folder: Path) -> QuickLook:
    """Look at the folder of a quick render of every lens, and finish it once to time that."""
    frame = read_frame(folder)
    layers, _ = read_finite(folder / LOW_RES_FILE)
    mask, wide = (foreground_mask(layers, frame.rays.tiles, reach) for reach in (0, 1))
    low = low_resolution(layers, frame, read_world(folder, frame))
    seconds = finish_frame(folder, FILL_METHOD if frame.scale > 1 else "none").seconds
    shown = low.alpha[shown_part(low.color)].size / low.alpha.size
    return QuickLook(strata_masks(mask, wide), features(low), {name: seconds[name] for name in FINISHING}, shown,
                     _world_seconds(low, mask))


def _world_seconds(low: LowResEIA, mask: Array) -> float:
    """Seconds of a whole frame's lenses outside ``mask``, which see only the world; 0 if it was not rendered apart."""
    world = low.world
    if world is None or low.places is None or mask.all():
        return 0.0
    rest = low.places[~mask]
    few = rest[:LENSES_TIMED]
    return _seconds(lambda: world.elemental_images(few)) * len(rest) / len(few) / _threads()


def features(low: LowResEIA) -> Array:
    """Features of each lens that may explain its accuracy, (sy, sx, 3): coverage, noise and detail.

    Noise is the split SSIM of the quick look against itself denoised; detail is the mean step between pixels of the
    denoised one. Without a denoiser, contrast takes the place of both, (sy, sx, 2).
    """
    shown, coverage = srgb_encode(low.color), low.alpha.mean((2, 3, 4))
    if not is_available():
        return np.stack([coverage, shown.std((2, 3)).mean(-1)], -1)
    denoised = srgb_encode(denoise_low_resolution(low).color)
    noisy, smooth = (values.reshape(-1, *values.shape[2:]) for values in (shown, denoised))
    alike = stacked_ssim(smooth, noisy, noisy).mean((1, 2)).reshape(coverage.shape)
    steps = (np.abs(np.diff(denoised, axis=axis)) for axis in (2, 3) if denoised.shape[axis] > 1)
    detail = sum((step.mean((2, 3, 4)) for step in steps), np.zeros(coverage.shape))
    return np.stack([coverage, alike, detail], -1)


def score(folder: Path, name: str, mosaic: Mosaic, reference: SampledReference) -> Scores:
    """Accuracy of the method ``name`` on a render of the sample.

    ``mosaic``: the sampled lenses (its centres) and their neighbours.
    """
    low, mask = _sampled(folder, mosaic)
    images = srgb_encode(finished_lenses(low, mask, name, mosaic.centres, block=mosaic.side))
    return split_scores(images, reference)


def split_scores(images: Array, reference: SampledReference) -> Scores:
    """Split SSIM of images (n, py, px, 3) in [0, 1]."""
    full = _mean_ssim(images, *reference.pair((0, 1), (2, 3)))
    less = (_mean_ssim(images, *reference.pair((0,), (2,))) + _mean_ssim(images, *reference.pair((1,), (3,)))) / 2
    return Scores(full, less)


def stage_time(folder: Path, name: str, mosaic: Mosaic, one: Mosaic) -> StageTime:
    """Time the method ``name`` on a render of the sample.

    ``mosaic`` and ``one``: all blocks of the sample, and one of them. Prefilters are timed on both, the rest per lens.
    """
    chosen = load_method(name)
    recovering = chosen.upscaler if isinstance(chosen.upscaler, Recovering) else None
    # Its cost grows with the foreground's lenses, not with pixels: it is timed apart.
    before = dataclasses.replace(chosen, upscaler=METHODS["none"].make()) if recovering else chosen
    (large, mask), (small, _) = (_sampled(folder, part) for part in (mosaic, one))
    low = before.prepare(small)  # load once before timing
    finish_lenses(chosen.upscaler, recovering.prepare(low) if recovering else low, one.centres)
    few, many = _seconds(lambda: before.prepare(small)), _seconds(lambda: before.prepare(large))
    ready, per_lens = before.prepare(large), 0.0
    if recovering:
        per_lens = _seconds(lambda: recovering.prepare(ready)) / max(int((ready.alpha.max((2, 3, 4)) > 0).sum()), 1)
        ready = recovering.prepare(ready)
    pixels = [low.alpha.size for low in (small, large)]
    per_pixel = max(many - few, 0.0) / max(pixels[1] - pixels[0], 1)
    lenses = mosaic.centres[mask] if mask.any() else mosaic.centres
    upscaling = _seconds(lambda: finish_lenses(chosen.upscaler, ready, lenses)) / len(lenses)
    threads = _threads() if chosen.upscaler.thread_safe else 1
    return StageTime(max(few - per_pixel * pixels[0], 0.0), per_pixel, per_lens + upscaling / threads)


def _sampled(folder: Path, mosaic: Mosaic) -> tuple[LowResEIA, Array]:
    """The mosaic of a rendered list of lenses, and (n,) bool: which of its centres are foreground."""
    frame = read_frame(folder)
    layers, _ = read_finite(folder / LOW_RES_FILE)
    low = low_resolution(layers, frame, read_world(folder, frame))
    return mosaic.of_render(low), mosaic.of_mask(foreground_mask(layers, frame.rays.tiles))


def _threads() -> int:
    return min(usable_cores(), MAX_WORKERS)


def _mean_ssim(images: Array, half_a: Array, half_b: Array) -> Array:
    means: Array = stacked_ssim(images, half_a, half_b).mean((1, 2))
    return means


def _seconds(work: Callable[[], Any]) -> float:
    started = time.perf_counter()
    work()
    return time.perf_counter() - started
