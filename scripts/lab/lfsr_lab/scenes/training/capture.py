"""Renders of one training scene as arrays, through the same code as the product's renders."""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np

from blender_addon.render.cycles import RenderSettings, Shot, render_encoded
from lfsr_core.base.arrays import Array
from lfsr_core.frames.frame import SUBPIXELS
from lfsr_core.images.exr import read_layers
from lfsr_core.optics.panel.panel_rays import PanelLayout
from lfsr_core.optics.rays import RayLayout
from lfsr_lab.scenes.training.stage import Stage

EXPOSURE_SAMPLES = 4
BRIGHTNESS = (0.05, 1.0)  # scene-linear, of the median foreground lens
OF_BRIGHT_LENS = 3.0  # times brighter, where another lens than the median counts
LEAST_COVERED = 0.02  # of a foreground lens
PANEL_TILE = (12, 6)  # pixels that count as a lens in an image of subpixels
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
LARGEST = 65504.0  # of float16


def render_low(stage: Stage, samples: int, seed: int, clamp: float | None = None) -> dict[str, Array]:
    """Render the low-resolution layers: color (RGBA), albedo, normal, each (H/s, W/s, C)."""
    return render(stage, stage.scale, RenderSettings(samples, seed, ("albedo", "normal"), clamp_indirect=clamp))


def render(stage: Stage, scale: int, settings: RenderSettings) -> dict[str, Array]:
    """Render the layers of the EIA at a scale, or of the panel's subpixels."""
    profile, array = stage.profile, stage.array
    shot = Shot(PanelLayout(profile, array), stage.matrix_world, SUBPIXELS) if stage.is_direct else \
        Shot(RayLayout.for_display(profile, array, scale), stage.matrix_world)
    with tempfile.TemporaryDirectory(prefix="lfsr-training-") as folder:
        path = Path(folder, "render.exr")
        render_encoded(bpy.context.scene, shot, settings, path)
        return read_layers(path)


def expose(stage: Stage, seed: int) -> tuple[float, float]:
    """Scale every light so that the stage's ``bright_lens`` has a random sensible brightness.

    Return the factor and the fraction of lenses that see anything.
    """
    wanted = stage.log_uniform(*BRIGHTNESS)
    wanted *= OF_BRIGHT_LENS if stage.bright_lens > 0.5 else 1.0
    lenses = lens_means(stage, render_low(stage, EXPOSURE_SAMPLES, seed)["color"])
    seen = lenses[lenses[..., 3] > LEAST_COVERED]
    brightness = np.quantile(seen[:, :3] @ LUMINANCE / seen[:, 3], stage.bright_lens) if len(seen) else 0.0
    factor = float(wanted / max(brightness, 1e-9))
    for owner, attribute in stage.dimmers:
        setattr(owner, attribute, getattr(owner, attribute) * factor)
    return factor, occupancy(lenses)


def lens_means(stage: Stage, image: Array) -> Array:
    """Mean of each elemental image, or of each tile of an image of subpixels, (rows, columns, C)."""
    sx, sy = stage.profile.lenses
    if stage.is_direct:
        sx, sy = image.shape[1] // PANEL_TILE[0], image.shape[0] // PANEL_TILE[1]
    image = np.nan_to_num(image.astype(np.float32))
    return image.reshape(sy, image.shape[0] // sy, sx, image.shape[1] // sx, -1).mean((1, 3))


def occupancy(means: Array) -> float:
    """Fraction of lenses that see anything."""
    return float((means[..., 3] > 0).mean())


def half_floats(image: Array) -> Array:
    """float16, clipped to its range, without NaN or infinity."""
    return np.clip(np.nan_to_num(image, posinf=LARGEST, neginf=0.0), -LARGEST, LARGEST).astype(np.float16)
