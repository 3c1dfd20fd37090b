"""Renders of one training scene as arrays, through the same code as the product's renders."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path

import bpy
import numpy as np

from blender_addon.render.cycles import RenderSettings, Shot, render_encoded
from lfsr_core.arrays import Array
from lfsr_core.frames.frame import SUBPIXELS
from lfsr_core.images.exr import read_layers
from lfsr_core.optics.panel.panel_rays import PanelLayout
from lfsr_core.optics.rays import RayLayout
from lfsr_lab.scenes.training.stage import Stage

EXPOSURE_SAMPLES = 4
BRIGHTNESS = (0.06, 0.5)  # scene-linear, of the median foreground lens
VARIED_BRIGHTNESS = (0.04, 0.9)
OF_BRIGHT_LENS = 3.0  # times brighter, where another lens than the median counts
PANEL_TILE = (12, 6)  # pixels that count as a lens in an image of subpixels
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
LARGEST = 65504.0  # of float16


@dataclasses.dataclass(frozen=True)
class Capture:
    """Renders a stage for one device."""

    stage: Stage
    scale: int
    device: str

    def low(self, samples: int, seed: int, clamp_indirect: float | None = None) -> dict[str, Array]:
        """Low-resolution layers: color (RGBA), albedo, normal, each (H/s, W/s, C)."""
        settings = RenderSettings(samples, seed, ("albedo", "normal"), self.device, clamp_indirect)
        return self._render(self.scale, settings)

    def high(self, samples: int, seed: int) -> Array:
        """High-resolution RGBA (H, W, 4), indirect light unclamped as in every reference."""
        settings = RenderSettings(samples, seed, (), self.device, clamp_indirect=0.0)
        return self._render(1, settings)["color"]

    def _render(self, scale: int, settings: RenderSettings) -> dict[str, Array]:
        profile, array = self.stage.profile, self.stage.array
        shot = Shot(PanelLayout(profile, array), self.stage.matrix_world, SUBPIXELS) if self.stage.is_direct else \
            Shot(RayLayout.for_display(profile, array, scale), self.stage.matrix_world)
        with tempfile.TemporaryDirectory(prefix="lfsr-training-") as folder:
            path = Path(folder, "render.exr")
            render_encoded(bpy.context.scene, shot, settings, path)
            return read_layers(path)


def expose(capture: Capture, seed: int) -> tuple[float, float]:
    """Scale every light so that the stage's ``bright_lens`` has a random sensible brightness.

    Return the factor and the fraction of lenses that see anything.
    """
    stage = capture.stage
    wanted = stage.log_uniform(*(VARIED_BRIGHTNESS if stage.is_varied else BRIGHTNESS))
    wanted *= OF_BRIGHT_LENS if stage.bright_lens > 0.5 else 1.0
    color = capture.low(EXPOSURE_SAMPLES, seed)["color"]
    found = lens_brightness(color, tiles(stage, color), stage.bright_lens)
    factor = float(wanted / max(found, 1e-9))
    for dimmer in stage.dimmers:
        dimmer.scale(factor)
    return factor, occupancy(color, tiles(stage, color))


def tiles(stage: Stage, image: Array) -> tuple[int, int]:
    """Columns and rows of lenses in an image; of a panel's subpixels, tiles of about a lens."""
    if stage.is_direct:
        return image.shape[1] // PANEL_TILE[0], image.shape[0] // PANEL_TILE[1]
    return stage.profile.lenses


def lens_brightness(color: Array, lenses: tuple[int, int], quantile: float = 0.5) -> float:
    """Quantile over foreground lenses of mean luminance per covered area; 0 without foreground."""
    sx, sy = lenses
    means = np.nan_to_num(color).reshape(sy, color.shape[0] // sy, sx, color.shape[1] // sx, 4).mean((1, 3))
    covered = means[..., 3] > 0.02
    if not covered.any():
        return 0.0
    return float(np.quantile(means[covered][:, :3] @ LUMINANCE / means[covered][:, 3], quantile))


def occupancy(color: Array, lenses: tuple[int, int]) -> float:
    """Fraction of lenses that see anything."""
    sx, sy = lenses
    alpha = color[..., 3].reshape(sy, color.shape[0] // sy, sx, color.shape[1] // sx)
    return float((alpha.max((1, 3)) > 0).mean())


def half_floats(image: Array) -> Array:
    """float16, clipped to its range, without NaN or infinity."""
    return np.clip(np.nan_to_num(image, posinf=LARGEST, neginf=0.0), -LARGEST, LARGEST).astype(np.float16)
