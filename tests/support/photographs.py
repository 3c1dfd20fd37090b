"""Photographs of a panel that shows a pattern, simulated: perspective, blur, noise, eight bits."""

from __future__ import annotations

import numpy as np

from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.trace import trace

RAYS = 4  # per pixel


def photograph(panel: np.ndarray, real: DisplayProfile, eye: tuple[float, float, float], size=(720, 512),
               noise: float = 0.02, seed: int = 0) -> np.ndarray:
    """(H, W, 3) in 0 … 1 of ``panel`` (uint8) through the sheet of ``real``.

    The camera is tilted a little and does not point at the panel's middle.
    """
    random, (columns, rows) = np.random.default_rng(seed), size
    # Axes of a camera at ``eye`` that looks past the middle, rolled by about a degree.
    aim = np.array([0.02 * real.panel_mm[0], -0.03 * real.panel_mm[1], 0]) - eye
    aim = aim / np.linalg.norm(aim)
    right = np.cross(aim, [0.02, 1, 0])
    right = right / np.linalg.norm(right)
    up = np.cross(right, aim)
    half = 0.62 * real.panel_mm[0] / eye[2]
    light, count = np.zeros((rows, columns, 3)), np.zeros((rows, columns, 3))
    for _ in range(RAYS):
        place = random.random((2, rows, columns))
        x = ((np.arange(columns) + place[0]) / columns - 0.5) * 2 * half
        y = (0.5 - (np.arange(rows)[:, None] + place[1]) / rows) * 2 * half * rows / columns
        ray = aim + x[..., None] * right + y[..., None] * up
        hit = np.array(eye) - ray * (eye[2] / ray[..., 2:])
        # A small lens focuses on about a pixel, not on a point of one colour.
        spread = (random.random((2, rows, columns)) - 0.5) * (1 if real.lenslet else 1 / 3)
        seen = trace(real, eye, hit[..., 0], hit[..., 1], (spread[0], spread[1]))
        values = panel[seen.row, seen.column] / 255 * seen.on_panel[..., None]
        shown = seen.channel[..., None] == np.arange(3)
        # A sensor's pixel spreads its neighbours' light; where no ray met a channel it has theirs.
        light += values * shown
        count += shown
    image = blurred(light) / np.maximum(blurred(count), 1e-9)
    image = image + random.normal(0, noise, image.shape)
    return np.rint(np.clip(image, 0, 1) * 255) / 255


def blurred(image: np.ndarray) -> np.ndarray:
    """With a binomial kernel five pixels wide."""
    for axis in (0, 1):
        padded = np.pad(image, [(2, 2) if number == axis else (0, 0) for number in range(3)], mode="edge")
        parts = [np.take(padded, np.arange(image.shape[axis]) + step, axis) for step in range(5)]
        image = sum(weight * part for weight, part in zip((1, 4, 6, 4, 1), parts, strict=True)) / 16
    return image
