"""The scale for a scene's depth: how many views to leave out before what lies deep is lost.

A point off the display plane moves by some lenses from one rendered view to the next, the more the larger the scale.
How much of a picture the second stage restores depends on that most (docs/results/stress.md).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.rays import CameraArray

MOST = 4  # largest scale that is chosen
LEAST_VIEWS = 5  # along each axis that a scale above 2 must leave: too few lie far apart, docs/results/displays.md
# Lenses by which rendered views may move what is seen, on average, at scale 2 and above it, where every view at as many
# rays would get so many samples. One sample or less no denoiser makes much of. docs/results/stress.md.
HALVED = {1: 1.38, 16: 0.52}
COARSER = {1: 0.75, 4: 0.52}
LOST = 2.0  # lenses from which on nothing more can be lost


@dataclasses.dataclass(frozen=True)
class ScaleChoice:
    """A scale and why."""

    scale: int
    samples: int  # per pixel
    reason: str = ""


def scales_up_to(display: DisplayProfile, most: int = MOST) -> tuple[int, ...]:
    """Scales to choose from, the largest first: those that divide the display's views and leave enough, and 1.

    Where none does, the smallest that divides them.
    """
    fewest = min((count for count in display.views if count > 1), default=1)
    usual = [scale for scale in display.scales() if scale <= most and (scale <= 2 or fewest >= LEAST_VIEWS * scale)]
    usual = usual or display.scales()[:1]
    return (*sorted(usual, reverse=True), 1)


def lenses_per_view(display: DisplayProfile, array: CameraArray, depths: Array) -> Array:
    """By how many lenses neighbouring views of the display move points at ``depths`` (n,) from the camera plane."""
    pitches = [2 * half / lenses for half, lenses, many in zip(
        (array.half_width, array.half_height), display.lenses, display.parallax, strict=True) if many]
    nearest = 1e-6 * array.distance
    return np.abs(array.distance / np.maximum(depths, nearest) - 1) * array.spacing / min(pitches, default=np.inf)


def choose_scale(display: DisplayProfile, array: CameraArray, depths: Array, scales: Collection[int],
                 samples: int) -> ScaleChoice:
    """The largest of ``scales`` whose missing views can be restored.

    Parameters
    ----------
    display, array : where the views stand
    depths : (n,) of points of the subject, spread over the picture, from the camera plane
    scales : to choose from; the smallest where none is small enough
    samples : per pixel; every view gets fewer, so that it takes as many rays as the smallest scale above 1
    """
    ordered, moves = sorted(scales, reverse=True), lenses_per_view(display, array, depths)
    largest = ordered[0]
    if not len(moves):
        return ScaleChoice(largest, samples, f"scale {largest}: the middle view sees nothing of the subject")
    scale = next((s for s in ordered if s > 1 and mean_move(moves, s) <= most_move(samples, s)), ordered[-1])
    moved = mean_move(moves, largest)
    if scale == largest:
        return ScaleChoice(scale, samples, f"scale {scale}: rendered views move what is seen by {moved:.2g} lenses on "
                                      "average, which can be restored")
    reason = (f"scale {scale} and not {largest}, at which rendered views would move what is seen by {moved:.2g} lenses "
              "on average: more than can be restored")
    if scale > 1:
        return ScaleChoice(scale, samples, reason)
    fewer = max(1, samples // min((s for s in ordered if s > 1), default=1) ** 2)
    return ScaleChoice(scale, fewer, f"{reason}; {fewer} of {samples} samples, for all views are rendered")


def mean_move(moves: Array, scale: int) -> float:
    """Lenses by which views rendered at ``scale`` move points that those of the display move by ``moves`` (n,)."""
    return float(np.minimum(moves * scale, LOST).mean())


def most_move(samples: int, scale: int) -> float:
    """The most of them that can be restored, against every view with as many rays."""
    most = HALVED if scale == 2 else COARSER
    return float(np.interp(np.log(samples / scale**2), np.log([*most]), [*most.values()]))
