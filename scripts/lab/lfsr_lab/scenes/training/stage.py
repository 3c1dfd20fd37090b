"""Random numbers, display window and notes that all parts of a training scene share.

World axes: X right, Z up, Y away from the viewer; the display plane is y = 0 with
half-width 1, the viewer at y = -distance.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.optics.display import DisplayProfile, Lattice, Lenslet, Lenticular, Subpixels
from lfsr_core.optics.rays import CameraArray

DEPTH_EXCESS = 1.5  # how far beyond the usable depth range objects may stand
DEEPEST, NEAREST = 3.0, 0.55  # limits in display half-widths and in viewing distances


@dataclasses.dataclass
class Stage:
    """Random numbers, display, depth limits, sources and notes of one scene."""

    rng: np.random.Generator
    profile: DisplayProfile
    scale: int  # of the low-resolution renders; 1 with a lens sheet: the panel's subpixels are rendered
    array: CameraArray
    # front, behind: how far objects may stand from the display plane, in scene units
    front: float
    behind: float
    textures: tuple[Path, ...]
    models: dict[Path, dict[str, str]]
    bright_lens: float = 0.5  # quantile of the foreground lenses' brightness that the exposure makes sensible
    pitch: float = 0.0  # radians by which the camera array is raised about the display's middle
    notes: list[dict[str, Any]] = dataclasses.field(default_factory=list)
    # (owner, attribute) of every strength of a light, which the exposure scales
    dimmers: list[tuple[Any, str]] = dataclasses.field(default_factory=list)

    @classmethod
    def for_display(cls, rng: np.random.Generator, profile: DisplayProfile, scale: int,
                    textures: tuple[Path, ...], models: dict[Path, dict[str, str]]) -> Stage:
        """Return a stage whose depth is random, up to 1.5 times the low-resolution array's usable range."""
        array = CameraArray.for_display(profile, 2.0)
        unit = 2.0 / profile.panel_mm[0]
        front, behind = (unit * depth for depth in profile.depth_range_mm(scale))
        fraction = DEPTH_EXCESS * rng.uniform(0.25, 1)
        return cls(rng, profile, scale, array, min(front * fraction, NEAREST * array.distance),
                   min(behind * fraction, DEEPEST), textures, models)

    @property
    def is_direct(self) -> bool:
        """Whether the panel's subpixels are rendered, not elemental images."""
        return self.profile.is_woven and self.scale == 1

    @property
    def camera_reach(self) -> float:
        """Distance of the outermost views from the array's middle."""
        return self.array.spacing / 2 * max(self.profile.views)

    @property
    def matrix_world(self) -> tuple[tuple[float, ...], ...]:
        """Camera-array space (+X right, +Y up, +Z to the display) to world, row by row."""
        sine, cosine, distance = math.sin(self.pitch), math.cos(self.pitch), self.array.distance
        return ((1.0, 0.0, 0.0, 0.0), (0.0, sine, cosine, -distance * cosine),
                (0.0, cosine, -sine, distance * sine), (0.0, 0.0, 0.0, 1.0))

    def note(self, what: str, **facts: Any) -> None:
        """Record one decision for the scene's description."""
        plain = {key: [round(float(v), 4) for v in value] if isinstance(value, (np.ndarray, tuple)) else
                 round(value, 4) if isinstance(value, float) else value for key, value in facts.items()}
        self.notes.append({"what": what, **plain})

    def window(self, depth: float, widen: float = 0.0) -> tuple[float, float]:
        """Half-width and half-height seen at y = depth: by the central view, or by all views with ``widen`` = 1."""
        near = (self.array.distance + depth) / self.array.distance
        reach = widen * abs(depth) / self.array.distance * self.array.spacing / 2
        return (self.array.half_width * near + reach * self.profile.views[0],
                self.array.half_height * near + reach * self.profile.views[1])

    def place(self, margin: float = 0.9) -> Array:
        """Random point in the viewing frustum, more often near the display plane than at the limits."""
        depth = float(self.rng.triangular(-self.front, 0, self.behind))
        width, height = self.window(depth)
        return np.array([self.rng.uniform(-width, width) * margin, depth, self.rng.uniform(-height, height) * margin])

    def chance(self, probability: float) -> bool:
        return bool(self.rng.random() < probability)

    def log_uniform(self, low: float, high: float) -> float:
        """Random value whose logarithm is uniform."""
        return float(math.exp(self.rng.uniform(math.log(low), math.log(high))))

    def pick(self, weights: Mapping[str, float]) -> str:
        """One key, chosen by weight."""
        values = np.array(list(weights.values()), float)
        return list(weights)[self.rng.choice(len(weights), p=values / values.sum())]


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
