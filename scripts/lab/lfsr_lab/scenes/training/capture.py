"""Renders of one training scene as arrays, through the same code as the product's renders."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path

import bpy
import numpy as np

from blender_addon.render.cycles import RenderSettings, Shot, render_encoded
from lfsr_core.arrays import Array
from lfsr_core.images.exr import read_layers
from lfsr_core.optics.rays import RayLayout
from lfsr_lab.scenes.training.stage import Stage

EXPOSURE_SAMPLES = 4
BRIGHTNESS = (0.06, 0.5)  # scene-linear, of the median foreground lens
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
LARGEST = 65504.0  # of float16


@dataclasses.dataclass(frozen=True)
class Capture:
    """Renders a stage for one device."""

    stage: Stage
    scale: int
    device: str

    def low(self, samples: int, seed: int) -> dict[str, Array]:
        """Low-resolution layers: color (RGBA), albedo, normal, each (H/s, W/s, C)."""
        return self._render(self.scale, RenderSettings(samples, seed, ("albedo", "normal"), self.device))

    def high(self, samples: int, seed: int) -> Array:
        """High-resolution RGBA (H, W, 4), indirect light unclamped as in every reference."""
        settings = RenderSettings(samples, seed, (), self.device, clamp_indirect=0.0)
        return self._render(1, settings)["color"]

    def _render(self, scale: int, settings: RenderSettings) -> dict[str, Array]:
        layout = RayLayout.for_display(self.stage.profile, self.stage.array, scale)
        with tempfile.TemporaryDirectory(prefix="lfsr-training-") as folder:
            path = Path(folder, "render.exr")
            render_encoded(bpy.context.scene, Shot(layout, self.stage.matrix_world), settings, path)
            return read_layers(path)


def expose(capture: Capture, seed: int) -> tuple[float, float]:
    """Scale every light so that the median foreground lens has a random sensible brightness.

    Returns the factor and the share of lenses that see anything.
    """
    stage = capture.stage
    wanted = stage.log_uniform(*BRIGHTNESS)
    color = capture.low(EXPOSURE_SAMPLES, seed)["color"]
    found = lens_brightness(color, stage.profile.lenses)
    factor = float(wanted / max(found, 1e-9))
    for dimmer in stage.dimmers:
        dimmer.scale(factor)
    return factor, occupancy(color, stage.profile.lenses)


def lens_brightness(color: Array, lenses: tuple[int, int]) -> float:
    """Median over foreground lenses of mean luminance per covered area; 0 without foreground."""
    sx, sy = lenses
    tiles = np.nan_to_num(color).reshape(sy, color.shape[0] // sy, sx, color.shape[1] // sx, 4).mean((1, 3))
    covered = tiles[..., 3] > 0.02
    return float(np.median(tiles[covered][:, :3] @ LUMINANCE / tiles[covered][:, 3])) if covered.any() else 0.0


def occupancy(color: Array, lenses: tuple[int, int]) -> float:
    """Share of lenses that see anything."""
    sx, sy = lenses
    alpha = color[..., 3].reshape(sy, color.shape[0] // sy, sx, color.shape[1] // sx)
    return float((alpha.max((1, 3)) > 0).mean())


def half_floats(image: Array) -> Array:
    """float16, clipped to its range, without NaN or infinity."""
    return np.clip(np.nan_to_num(image, posinf=LARGEST, neginf=0.0), -LARGEST, LARGEST).astype(np.float16)
