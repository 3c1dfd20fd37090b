"""How long an image will take, from a render of a few lenses of its scene."""

from __future__ import annotations

import math

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.optics.depth_scale import samples_at
from lfsr_core.optics.panel.panel_rays import rendered_size
from lfsr_core.reconstruct.methods import seconds
from lfsr_core.tasks.estimate import Measured

from ..scene import settings as scene_settings


def remember(scene_name: str, measured: Measured) -> None:
    """Store what was measured for the panel, and for other settings of the same scene."""
    state = bpy.context.window_manager.lfsr
    state.probe_scene = scene_name
    state.probe_fixed, state.probe_per_path, state.probe_scale = measured.fixed, measured.per_path, measured.scale


def expected_seconds(scene: bpy.types.Scene) -> float | None:
    """Seconds that an image of ``scene`` will take with its settings of now; None where nothing was measured."""
    state = bpy.context.window_manager.lfsr
    if state.probe_scene != scene.name_full:
        return None
    try:
        settings = scene_settings.resolve(scene)
        display, scale = settings.display, state.probe_scale if settings.sampling.scales else settings.sampling.scale
        samples = settings.sampling.samples if settings.rays is None else samples_at(display, scale, settings.rays)
    except LfsrError:
        return None  # the panel says what is wrong
    size = rendered_size(display) if settings.subpixels else display.eia_pixels
    paths = math.prod(size) / display.finished_pixels(scale) * samples
    finish = seconds(display, scale, settings.finish.method, settings.request.layout)
    return float(state.probe_fixed + state.probe_per_path * paths + finish)
