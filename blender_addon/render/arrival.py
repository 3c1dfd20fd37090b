"""Measure with a tiny render how much light arrives at the array."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path

import bpy
import numpy as np

from lfsr_core.frames.job import Job
from lfsr_core.images.exr import clean, read_layers
from lfsr_core.optics.rays import RayLayout

from ..array import placement
from . import devices
from .cycles import RenderSettings, Shot, render_encoded

LENSES = (8, 5)     # across and down, spread over the display
SAMPLES = 4
FIREFLIES = 99      # percentile of brightness that counts: single bright pixels do not
# Scene-linear: at most 8 of 255 in every view transform of Blender 5.0, without a look (measured).
DARK = 2e-3


def is_dark(scene: bpy.types.Scene, job: Job, subject: set[bpy.types.Object]) -> bool:
    """Return True if a few lenses see objects, but too dark for any view transform at the scene's exposure."""
    array, matrix_world = placement.place_array(scene, job.display, subject)
    layout = RayLayout.for_display(job.display, array, max(job.display.scales(), default=1), lens_list=_lenses(job))
    shot = Shot(layout, matrix_world, devices.way_of(job.device), placement.clip_of(scene))
    # In Blender's own temporary folder, which is removed even if Blender crashes.
    with tempfile.TemporaryDirectory(prefix="lfsr-light-", dir=bpy.app.tempdir or None) as name:
        path = Path(name, "light.exr")
        render_encoded(scene, shot, dataclasses.replace(RenderSettings(SAMPLES), device=job.device), path)
        color = clean(read_layers(path))[0]["color"]
    seen = color[..., 3] > 0
    if not seen.any():
        return False
    brightest = np.percentile(color[seen][:, :3].max(-1), FIREFLIES)
    return bool(brightest * 2.0**scene.view_settings.exposure < DARK)


def _lenses(job: Job) -> tuple[tuple[int, int], ...]:
    (sx, sy), (across, down) = job.display.lenses, LENSES
    columns, rows = (((np.arange(count) + 0.5) * size / count).astype(int)
                     for count, size in ((min(across, sx), sx), (min(down, sy), sy)))
    return tuple((int(row), int(column)) for row in rows for column in columns)
