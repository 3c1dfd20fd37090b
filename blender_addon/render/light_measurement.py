"""Measure with a tiny render how much light arrives at what the array sees, and choose the light of a scene."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import bpy
import numpy as np

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice
from lfsr_core.frames.request import EVEN, OWN, Request
from lfsr_core.images.exr import clean, read_layers

from ..scene import devices
from ..scene.array import placement
from ..scene.light import DEFAULT_LIGHT, DIM, has_light, is_certain, lit
from ..scene.subject import find_subject
from .cycles import FOREGROUND, RenderSettings, cycles_settings, pass_indices, temporary_camera
from .output import render_to

WIDTH, SAMPLES = 64, 4  # pixels across, and samples per pixel
# Darker surfaces count as if they reflected this much: black things in good light are not in the dark.
LEAST_ALBEDO = 0.1


def chosen_light(scene: bpy.types.Scene, request: Request, say: Callable[[Notice], object]) -> str:
    """Return the light of ``scene`` where the request leaves that open; ``say`` unless it is the scene's own.

    A .blend keeps its own light if it has any, with a warning where that is too little.
    """
    has_own = has_light(scene)
    if has_own and (is_certain(scene) or not is_dark(scene, request)):
        return OWN
    if has_own and Path(request.scene).suffix.lower() in ("", ".blend"):
        say(Notice("light-weak"))
        return OWN
    with lit(scene, DEFAULT_LIGHT):
        light = EVEN if is_dark(scene, request) else DEFAULT_LIGHT
    say(Notice("light-replaced", {"reason": "dark" if has_own else "none", "light": light}))
    return light


def is_dark(scene: bpy.types.Scene, request: Request) -> bool:
    """Return True if most of the subject that the middle of the array sees is hardly lit, at the scene's exposure.

    What shines does not count by its brightness but by its size: half of the subject decides. False also where the
    subject is not in sight; the render says that.
    """
    light = np.empty(0)
    with suppress(LfsrError):
        light = _arriving(scene, request)
    return bool(light.size and np.median(light) * 2.0**scene.view_settings.exposure < DIM)


def _arriving(scene: bpy.types.Scene, request: Request) -> np.ndarray:
    """Brightness (n,) that a white surface would have in place of each pixel of the subject."""
    subject = find_subject(scene, request.subject)
    array, matrix_world = placement.place_array(scene, request.display, subject)
    size = WIDTH, max(round(WIDTH * array.half_height / array.half_width), 4)
    settings = RenderSettings(SAMPLES, layers=("albedo", "index"), device=devices.resolved(request.device))
    # In Blender's own temporary folder, which is removed even if Blender crashes.
    with (tempfile.TemporaryDirectory(prefix="lfsr-light-", dir=bpy.app.tempdir or None) as name,
          pass_indices(subject), temporary_camera(scene, matrix_world, array.distance) as camera,
          cycles_settings(scene, settings, size)):
        lens, clip, path = camera.data, placement.clip_of(scene), Path(name, "light.exr")
        lens.sensor_fit, lens.lens = "HORIZONTAL", lens.sensor_width / 2 * array.distance / array.half_width
        lens.clip_start, lens.clip_end = clip or (lens.clip_start, lens.clip_end)
        render_to(scene, path)
        layers = clean(read_layers(path))[0]
    seen = (layers["color"][..., 3] > 0.5) & (layers["index"][..., 0] == FOREGROUND)
    color, albedo = layers["color"][seen][:, :3].max(-1), layers["albedo"][seen].max(-1)
    light: np.ndarray = color / np.maximum(albedo, LEAST_ALBEDO)
    return light
