"""The outline of a lit panel in a photograph."""

from __future__ import annotations

import math

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError

SMALL = 240  # pixels of the longer side in which the panel is looked for
LIT = 0.4  # of the light of the photograph's middle
MIN_SIDE = 100  # pixels of the panel's shortest side
MIN_PICTURE = 200  # of the photograph's shorter side
CLIPPED, MOST_CLIPPED = 0.985, 0.06  # value of a saturated channel, and how much of the panel may be that bright
LEAST_LIGHT, LEAST_COLOR = 0.15, 0.08  # of the brightest parts; of the channels' difference, by their mean
ANGLES = 24  # of a quarter turn, in which corners are looked for


def outline(image: Array) -> Array:
    """Return the corners (4, 2) of the lit quadrangle in the middle of a photograph (H, W, 3), clockwise, as places.

    LfsrError if nothing is lit there, or it is too small.
    """
    height, width = image.shape[:2]
    if min(height, width) < MIN_PICTURE:
        raise LfsrError(f"the photograph has {width}×{height} pixels, but its shorter side needs at least "
                        f"{MIN_PICTURE}: send the original, not a preview")
    step = max(1, math.ceil(max(height, width) / SMALL))
    rows, columns = (np.arange(step // 2, count, step) for count in (height, width))
    padded = np.pad(image[np.ix_(rows, columns)].max(-1), 1, mode="edge")
    high, wide = len(rows), len(columns)
    light = np.asarray(sum(padded[y:y + high, x:x + wide] for y in range(3) for x in range(3)) / 9)
    middle = np.s_[high * 2 // 5:high * 3 // 5 + 1, wide * 2 // 5:wide * 3 // 5 + 1]
    brightness = float(np.median(light[middle]))
    lit = light > LIT * brightness
    part = np.zeros_like(lit)  # of what is lit, all that hangs together with the middle
    part[middle] = lit[middle]
    count = -1
    while count != (count := int(part.sum())):
        for _ in range(8):
            grown = np.pad(part, 1)
            part = lit & (grown[1:-1, 1:-1] | grown[:-2, 1:-1] | grown[2:, 1:-1] | grown[1:-1, :-2] | grown[1:-1, 2:])
    row, column = np.nonzero(part)
    if brightness < 0.02 or len(row) < lit.size / 100:
        raise LfsrError("no lit panel is seen in the photograph: photograph the phase pattern in a dark room, with the "
                        "panel in the middle of the image")
    # Of the quadrangles that points which lie farthest in four directions make, the largest.
    points, best = np.stack([columns[column], rows[row]], -1).astype(float), -1.0
    for angle in np.arange(ANGLES) * math.pi / 2 / ANGLES:
        ways = angle + np.arange(4) * math.pi / 2
        ends = points[(points @ np.stack([np.cos(ways), np.sin(ways)])).argmax(0)]
        x, y = ends.T
        area = float(abs((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()))
        if area > best:
            best, found = area, ends
    return np.asarray((found - [(width - 1) / 2, (height - 1) / 2]) / (math.hypot(height, width) / 2))


def check_size(image: Array, corners: Array) -> None:
    """LfsrError if a photograph, or the panel in it, is too small."""
    height, width = image.shape[:2]
    side = float(np.linalg.norm(corners - np.roll(corners, 1, 0), axis=1).min()) * math.hypot(height, width) / 2
    if side < MIN_SIDE:
        raise LfsrError(f"the panel's shortest side is {side:.0f} pixels in the photograph, but at least {MIN_SIDE} "
                        "are needed: come nearer, or use a longer lens from the same place")


def check_light(panel: Array) -> None:
    """LfsrError if the pixels (…, 3) of the panel in a photograph are too bright, too dark or grey."""
    clipped = float((panel >= CLIPPED).mean((0, 1)).max())
    if clipped > MOST_CLIPPED:
        raise LfsrError(f"the photograph is overexposed ({clipped:.0%} of the panel is white in a channel): touch the "
                        "panel on the telephone's screen, pull the brightness down and take it again")
    if np.percentile(panel.max(-1), 95) < LEAST_LIGHT:
        raise LfsrError("the photograph is too dark: make the panel brighter, or expose longer, and take it again")
    if np.ptp(panel, axis=-1).mean() < LEAST_COLOR * panel.mean():
        raise LfsrError("the photograph has no colours, but the pattern's channels are measured one by one: switch "
                        "filters off and photograph in colour")
