"""Measure the wave of fringes: roughly by the strongest response, then by the phase in windows all over the panel.

What the phases of the windows differ by from a wave says how uncertain the wave is.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import NamedTuple

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError

MIN_CONTRAST = 0.02  # amplitude of fringes, where white is 1
MIN_FRACTION = 0.08  # of a channel's variation that its fringes must make up
REACH = 0.45  # most difference of the wave that is seen from the expected one, as a fraction of the latter
MOST_WINDOWS, LEAST_WINDOWS, FRINGES = 9, 3, 3.0  # windows along each side, each of this many fringes if there is room
MIN_AMPLITUDE = 0.35  # of a window's fringes, by the median
MOST_COVERED = 0.06  # of the windows
MOST_SCATTER = 0.06  # of the phases, in fringes
OVERLAP = 4 / 3  # neighbouring windows share a sixth of their errors, so the mean errs by this much more


class Picture(NamedTuple):
    """A channel of the panel seen from the front, in millimetres from the panel's centre."""

    values: Array  # (rows, columns)
    x: Array  # (columns,)
    y: Array  # (rows,), upwards
    dots: Array  # (rows, columns) what a camera that mixes colours adds of the dots


@dataclasses.dataclass(frozen=True)
class Fringes:
    """A wave: cos of 2π (wave · place + phase)."""

    wave: Array  # (2,) per millimetre
    phase: float  # at the panel's centre
    errors: Array  # (3, 3) covariance of wave and phase
    seen: Array = dataclasses.field(default_factory=lambda: np.zeros(2))  # the wave in the photograph


def find_fringes(picture: Picture, expected: Array, other: Array) -> Fringes:
    """Return the fringes whose wave lies near the ``expected`` one (2,).

    ``other``: by how much the wave of the fringes that a camera which mixes colours adds is a different one.
    LfsrError if they are not clear, hidden in places, or bent.
    """
    # The wave with the strongest response.
    rows, columns = picture.values.shape
    window = np.hanning(rows + 2)[1:-1, None] * np.hanning(columns + 2)[None, 1:-1]
    light = picture.values - (picture.values * window).sum() / window.sum()
    weighted, reach = light * window, REACH * float(np.linalg.norm(expected))
    wave, step, around = np.array(expected, float), reach / 12, 12
    while step * max(np.ptp(picture.x), np.ptp(picture.y)) > 1e-3:
        steps = np.arange(-around, around + 1) * step
        right, up = wave[0] + steps, wave[1] + steps
        sums = np.abs(_spectrum(weighted, picture, right, up))
        row, column = np.unravel_index(sums.argmax(), sums.shape)
        wave, step, around = np.array([right[column], up[row]]), step / 4, 5
    contrast = 2 * abs(_spectrum(weighted, picture, wave[:1], wave[1:])[0, 0] / window.sum())
    variation = float((light ** 2 * window).sum() / window.sum())
    fraction = contrast ** 2 / 2 / max(variation, 1e-12)
    if contrast < MIN_CONTRAST or fraction < MIN_FRACTION or np.linalg.norm(wave - expected) > 0.95 * reach:
        raise LfsrError(f"no clear fringes are seen (contrast {contrast:.3f}, {fraction:.0%} of the variation): the "
                        "photograph may be blurred, the lenses too small in it, or the profile too far from the sheet")

    # The centre (x, y) of each window, and the cosine and sine of its light at the wave; neighbours overlap by half.
    most = float(np.abs(wave * [np.ptp(picture.x), np.ptp(picture.y)]).max())
    count = int(np.clip(2 * most / FRINGES - 1, LEAST_WINDOWS, MOST_WINDOWS))
    centres, factors = [], []
    for number in itertools.product(range(count), range(count)):
        high, wide = (slice(*(round(len(axis) * (one + step) / (count + 1)) for step in (0, 2)))
                      for axis, one in zip((picture.y, picture.x), number, strict=True))
        x, y = picture.x[wide], picture.y[high]
        weights = np.sqrt(np.hanning(len(y) + 2)[1:-1, None] * np.hanning(len(x) + 2)[None, 1:-1]).ravel()
        turn, added = (2 * math.pi * np.add.outer(y * one[1], x * one[0]).ravel() for one in (wave, wave + other))
        values, light = picture.values[high, wide].ravel(), picture.dots[high, wide].ravel()
        slope_x, slope_y = (np.broadcast_to(part, (len(y), len(x))).ravel()
                            for part in (x - x.mean(), (y - y.mean())[:, None]))
        known = np.stack([np.cos(turn), np.sin(turn), np.cos(added), np.sin(added), np.ones_like(turn),
                          slope_x / np.abs(slope_x).max(), slope_y / np.abs(slope_y).max(), light - light.mean()], -1)
        known *= weights[:, None]
        square = known.T @ known
        factors.append(np.linalg.solve(square + 1e-9 * np.trace(square) * np.eye(8), known.T @ (values * weights))[:2])
        centres.append([x.mean(), y.mean()])
    places, fitted = np.array(centres), np.array(factors)
    first = fitted[:, 0] - 1j * fitted[:, 1]
    seen = np.abs(first) >= MIN_AMPLITUDE * np.median(np.abs(first))
    if (~seen).mean() > MOST_COVERED:
        x, y = places[~seen].mean(0) / np.abs(places).max(0)
        down = "upper " if y > 0.3 else "lower " if y < -0.3 else ""
        across = "right" if x > 0.3 else "left" if x < -0.3 else "part" if down else "middle"
        raise LfsrError(f"the {down}{across} of the panel shows no fringes: uncover the whole panel, and keep lamps "
                        "and windows from being mirrored in it")
    # The wave whose phases come nearest to those of the windows.
    places, first = places[seen], first[seen]
    middle = np.angle(first.sum())
    phases = np.angle(first * np.exp(-1j * middle)) / 2 / math.pi
    known = np.concatenate([places, np.ones((len(places), 1))], -1)
    solved, *_ = np.linalg.lstsq(known, phases, rcond=None)
    rest = phases - known @ solved
    scatter = math.sqrt(float((rest ** 2).sum()) / max(len(rest) - 3, 1))
    if scatter > MOST_SCATTER:
        raise LfsrError(f"the fringes are not straight (they scatter by {scatter:.2f} of a fringe): take the whole, "
                        "uncropped photograph with the main camera, sharp, without zoom")
    return Fringes(wave + solved[:2], float(solved[2] + middle / 2 / math.pi),
                   np.linalg.inv(known.T @ known) * (scatter * OVERLAP) ** 2)


def _spectrum(weighted: Array, picture: Picture, across: Array, up: Array) -> Array:
    """(len(up), len(across)) sums of the image times waves of these numbers per millimetre."""
    right = np.exp(-2j * math.pi * np.outer(picture.x, across))
    sums: Array = np.exp(-2j * math.pi * np.outer(up, picture.y)) @ (weighted @ right)
    return sums
