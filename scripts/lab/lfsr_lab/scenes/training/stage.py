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
from lfsr_core.optics.display import DisplayProfile
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
        """True with the given probability."""
        return bool(self.rng.random() < probability)

    def log_uniform(self, low: float, high: float) -> float:
        """Random value whose logarithm is uniform."""
        return float(math.exp(self.rng.uniform(math.log(low), math.log(high))))

    def pick(self, weights: Mapping[str, float]) -> str:
        """One key, chosen by weight."""
        values = np.array(list(weights.values()), float)
        return list(weights)[self.rng.choice(len(weights), p=values / values.sum())]
