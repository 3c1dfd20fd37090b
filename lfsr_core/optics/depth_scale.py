"""How many views to render, and with how many samples: the scale that a scene's depth and a number of rays call for.

A number of rays per finished pixel can be many samples of few views (a large scale) or few samples of many views. A
large scale has less noise, but a point off the display plane moves further from one rendered view to the next (its
disparity), and the second stage restores less of it. ``choose_scale`` takes the scale whose predicted loss is least.
"""

import dataclasses
import math
from collections.abc import Collection

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import Notice
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.rays import CameraArray

LEAST_SAMPLES = 0.999  # per pixel at a scale that is chosen: quotients of samples and pixels are not exact


@dataclasses.dataclass(frozen=True)
class LossModel:
    """Predicted loss of accuracy, in SSIM: of detail, by points that move between rendered views, and by noise.

    Both terms make the choice monotonic: the deeper a point and the more rays, the more a smaller scale gains.
    """

    # detail · ln(1 + disparity / lenses), mean over the points that are seen
    detail: float
    lenses: float
    # noise · samples ** -power
    noise: float
    power: float

    def loss(self, moves: Array, scale: int, samples: float) -> float:
        """Predicted loss at ``scale`` with ``samples`` per pixel, for ``moves`` (n,) between the display's views."""
        lost = self.detail * float(np.log1p(moves * scale / self.lenses).mean()) if len(moves) else 0.0
        return lost + self.noise * math.pow(samples, -self.power)


# Fitted by `lfsr study scales docs/results/measured/scales.json`, see docs/results/stress.md.
MODEL = LossModel(detail=0.152, lenses=0.297, noise=0.192, power=0.5)


@dataclasses.dataclass(frozen=True)
class ScaleChoice:
    """A scale and why it was chosen."""

    scale: int
    reason: Notice | None = None  # None where it was asked for


def disparities(display: DisplayProfile, array: CameraArray, depths: Array) -> Array:
    """Lenses by which neighbouring views of the display move points at ``depths`` (n,) from the camera plane."""
    pitches = [2 * half / lenses for half, lenses, many in zip(
        array.half_size, display.lenses, display.parallax, strict=True) if many]
    off_plane: Array = np.abs(array.distance / np.maximum(depths, 1e-6 * array.distance) - 1)
    return np.divide(off_plane * array.spacing, min(pitches, default=math.inf))


def choose_scale(display: DisplayProfile, moves: Array, scales: Collection[int], rays: float,
                 model: LossModel = MODEL) -> ScaleChoice:
    """Return the scale with the least predicted loss; of equal ones, the largest.

    ``moves`` (n,): disparities of points of the subject, spread over the image, as of ``disparities``; ``scales``:
    candidates, without those that would get less than one sample, unless all would; ``rays``: per finished pixel;
    ``model``: predicts the loss.
    """
    samples = {scale: rays * display.finished_pixels(scale) for scale in sorted(scales, reverse=True)}
    largest = next(iter(samples))
    enough = [scale for scale, count in samples.items() if count >= LEAST_SAMPLES] or [largest]
    scale = min(enough, key=lambda scale: model.loss(moves, scale, samples[scale]))
    if not len(moves):
        return ScaleChoice(scale, Notice("scale-unseen", {"scale": scale}))
    # Half of the subject moves by at least so many lenses between neighbouring views of the display.
    return ScaleChoice(scale, Notice("scale-chosen", {"scale": scale, "largest": largest, "rays": rays,
                                                      "moved": float(np.median(moves))}))
