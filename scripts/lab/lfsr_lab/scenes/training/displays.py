"""Displays of the training scenes: pixels, pitches and angles as of real ones, few lenses."""

from __future__ import annotations

import numpy as np

from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.sheet import Lattice, Lenslet, Lenticular, Subpixels

TRAIN = "train"
RENDERED_VIEWS = (5, 6, 8, 10, 10, 10, 12, 16, 20)  # per lens and axis
RENDERED_PIXELS = (32_000, 46_000)
MORE_PIXELS, MANY_VIEWS = 1.35, 12  # factor from so many views on
WIDTH_MM, PANEL_PIXELS = 300.0, (132, 96)  # of the display, of a panel of subpixels
KINDS = {"both": 0.76, "horizontal": 0.14, "subpixels": 0.1}  # parallax, or a panel with a lens sheet


def training_display(rng: np.random.Generator) -> tuple[DisplayProfile, int]:
    """Return a display, and its scale: 2 to 5, or 1 where subpixels are rendered."""
    kind = rng.choice(list(KINDS), p=list(KINDS.values()))
    distance, angle = WIDTH_MM * float(np.exp(rng.uniform(*np.log([1.2, 10])))), round(float(rng.uniform(25, 50)), 1)
    if kind == "subpixels":
        return _panel(rng, distance, angle), 1
    count, scale, pixels = int(rng.choice(RENDERED_VIEWS)), int(rng.integers(2, 6)), rng.uniform(*RENDERED_PIXELS)
    pixels *= MORE_PIXELS if count >= MANY_VIEWS else 1.0
    rows = 1 if kind == "horizontal" else count
    across = round(float(np.sqrt(pixels / (count * rows) * rng.uniform(1.2, 1.7))))
    lenses = across, max(2, round(pixels / (count * rows * across)))
    panel_mm = WIDTH_MM, WIDTH_MM * lenses[1] / lenses[0]
    if kind == "horizontal":  # as of a lenticular display, whose light field is rendered
        return DisplayProfile(TRAIN, (3 * lenses[0], 3 * lenses[1]), panel_mm, lenses, (count * scale, 1), distance,
                              angle, "direct", lenticular=Lenticular(WIDTH_MM / lenses[0])), scale
    views = count * scale
    return DisplayProfile(TRAIN, (lenses[0] * views, lenses[1] * views), panel_mm, lenses, (views, views), distance,
                          angle), scale


def _panel(rng: np.random.Generator, distance: float, angle: float) -> DisplayProfile:
    """A panel whose subpixels send rays of their own, with cylinders or small lenses before it."""
    width, height = PANEL_PIXELS
    pitch, pixel = float(rng.uniform(4, 12)), WIDTH_MM / width
    is_lenticular = rng.random() < 0.6
    slant = float(rng.choice([-1, 1]) * rng.uniform(0.08, 0.35))
    lenticular = Lenticular(pitch * pixel, slant) if is_lenticular else None
    lattice = Lattice((pitch * pixel,) * 2, float(rng.uniform(-10, 10)))
    lenslet = None if is_lenticular else Lenslet(lattice, str(rng.choice(["square", "hexagonal"])))
    lenses, views = (round(width / pitch), round(height / pitch)), round(3 * pitch)
    return DisplayProfile(TRAIN, PANEL_PIXELS, (WIDTH_MM, height * pixel), lenses,
                          (views, 1) if is_lenticular else (views, views), distance, angle, "direct",
                          subpixels=Subpixels("rgb"), lenticular=lenticular, lenslet=lenslet)
