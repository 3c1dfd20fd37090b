"""How long an image will take, from a render of its scene or of a few of its lenses, else from this machine's last."""

from __future__ import annotations

import math

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.frame import Frame
from lfsr_core.optics.depth_scale import samples_at
from lfsr_core.optics.panel.subpixel_rays import rendered_size
from lfsr_core.reconstruct.methods import seconds
from lfsr_core.tasks.estimate import Measured

from ..scene import settings as scene_settings
from . import runtime

START = 4.0  # seconds until another Blender has opened a small scene, on two cores
LEAST_PATHS = 10**5  # of a render that tells how fast this machine is
SAME = 0.2  # relative change of that below which the preference stays


def remember(scene_name: str, measured: Measured) -> None:
    """Store what was measured for the panel, and for other settings of the same scene."""
    state = bpy.context.window_manager.lfsr
    state.probe_scene = scene_name
    state.probe_fixed, state.probe_per_path, state.probe_scale = measured.fixed, measured.per_path, measured.scale


def learn(scene_name: str, frame: Frame) -> None:
    """Store what the render of ``frame`` has told of its scene, and how fast this machine is."""
    paths, taken = math.prod(frame.rays.size) * frame.samples, frame.seconds["render"]
    if taken <= 0 or paths < LEAST_PATHS or frame.subpixels:
        return
    if bpy.context.window_manager.lfsr.probe_scene != scene_name:
        remember(scene_name, Measured(START, taken / paths, frame.scale))
    preferences = runtime.preferences_of_addon()
    if preferences is not None and abs(preferences.seconds_per_path * paths / taken - 1) > SAME:
        preferences.seconds_per_path = taken / paths
        bpy.context.preferences.is_dirty = True  # Blender saves them as it quits


def expected_seconds(scene: bpy.types.Scene) -> float | None:
    """Seconds that an image of ``scene`` will take with its settings of now.

    None where nothing was measured, neither of the scene nor on this machine.
    """
    state = bpy.context.window_manager.lfsr
    is_measured = state.probe_scene == scene.name_full
    per_path = state.probe_per_path if is_measured else getattr(runtime.preferences_of_addon(), "seconds_per_path", 0.0)
    if not per_path:
        return None
    try:
        settings = scene_settings.resolve(scene)
        display, sampling = settings.display, settings.sampling
        scale = state.probe_scale if sampling.scales and is_measured else sampling.scale
        samples = sampling.samples if settings.rays is None else samples_at(display, scale, settings.rays)
    except LfsrError:
        return None  # the panel says what is wrong
    size = rendered_size(display) if settings.subpixels else display.eia_pixels
    paths = math.prod(size) / display.finished_pixels(scale) * samples
    finish = seconds(display, scale, settings.finish.method, settings.request.layout)
    return float((state.probe_fixed if is_measured else START) + per_path * paths + finish)
