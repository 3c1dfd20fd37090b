"""The scale for a scene's depth: how many views to leave out before detail far from the display plane is lost.

A point off the display plane moves by some lenses (its disparity) from one rendered view to the next, further at
larger scales. The second stage restores less the larger this disparity is (docs/results/stress.md).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.rays import CameraArray

MAX_SCALE = 4  # that is chosen
MIN_VIEWS = 5  # along each axis that a scale above 2 must leave (docs/results/displays.md)
# Largest mean disparity, in lenses, that can be restored, by the samples per pixel that rendering every view with as
# many rays would get: at scale 2, and above it. docs/results/stress.md
MAX_DISPARITY = {1: 1.38, 16: 0.52}
MAX_DISPARITY_COARSE = {1: 0.75, 4: 0.52}
LOST = 2.0  # lenses of disparity from which on nothing more can be lost


@dataclasses.dataclass(frozen=True)
class ScaleChoice:
    """A scale and why it was chosen."""

    scale: int
    samples: int  # per pixel
    reason: str = ""


def scales_up_to(display: DisplayProfile, most: int = MAX_SCALE) -> tuple[int, ...]:
    """Scales to choose from, the largest first: those that divide the display's views and leave enough, and 1.

    If there are none, the smallest that divides the views, and 1.
    """
    fewest = min((count for count in display.views if count > 1), default=1)
    usual = [scale for scale in display.scales() if scale <= most and (scale <= 2 or fewest >= MIN_VIEWS * scale)]
    return (*sorted(usual or display.scales()[:1], reverse=True), 1)


def disparities(display: DisplayProfile, array: CameraArray, depths: Array) -> Array:
    """Lenses by which neighbouring views of the display move points at ``depths`` (n,) from the camera plane."""
    pitches = [2 * half / lenses for half, lenses, many in zip(
        array.half_size, display.lenses, display.parallax, strict=True) if many]
    nearest = 1e-6 * array.distance
    off_plane: Array = np.abs(array.distance / np.maximum(depths, nearest) - 1)
    return np.divide(off_plane * array.spacing, min(pitches, default=np.inf))


def choose_scale(display: DisplayProfile, array: CameraArray, depths: Array, scales: Collection[int],
                 samples: int) -> ScaleChoice:
    """Return the largest of ``scales`` whose missing views can be restored, else the smallest.

    Parameters
    ----------
    display, array : where the views stand
    depths : (n,) of points of the subject, spread over the image, from the camera plane
    scales : to choose from
    samples : per pixel; scale 1 gets fewer, so that it takes as many rays as the smallest scale above 1
    """
    ordered, moves = sorted(scales, reverse=True), disparities(display, array, depths)
    largest = ordered[0]
    if not len(moves):
        return ScaleChoice(largest, samples, f"scale {largest}: the middle view sees nothing of the subject")
    scale = next((s for s in ordered if s > 1 and mean_disparity(moves, s) <= max_disparity(samples, s)), ordered[-1])
    moved = mean_disparity(moves, largest)
    if scale == largest:
        return ScaleChoice(scale, samples, f"scale {scale}: neighbouring rendered views differ by {moved:.2g} lenses "
                                           "on average, which can be restored")
    reason = (f"scale {scale} and not {largest}, at which neighbouring rendered views would differ by {moved:.2g} "
              "lenses on average: more than can be restored")
    if scale > 1:
        return ScaleChoice(scale, samples, reason)
    fewer = max(1, samples // min((s for s in ordered if s > 1), default=1) ** 2)
    return ScaleChoice(scale, fewer, f"{reason}; {fewer} of {samples} samples, for all views are rendered")


def mean_disparity(moves: Array, scale: int) -> float:
    """Mean disparity between views rendered at ``scale``, for ``moves`` (n,) between those of the display."""
    return float(np.minimum(moves * scale, LOST).mean())


def max_disparity(samples: int, scale: int) -> float:
    """Largest mean disparity that can be restored better than by rendering every view with as many rays."""
    most = MAX_DISPARITY if scale == 2 else MAX_DISPARITY_COARSE
    return float(np.interp(np.log(samples / scale**2), np.log([*most]), [*most.values()]))
