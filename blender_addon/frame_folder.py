"""A job's frame folder: place the array, render, write ``frame.json``."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import bpy

from blender_addon import passes, render, rig, scene_io
from blender_addon.job import Job
from blender_addon.overrides import overridden
from lfsr_core.frame import LOW_RES_FILE, ColorSettings, Frame, write_frame

Progress = Callable[..., None]


def render_job(scene: bpy.types.Scene, job: Job, opened: float = 0.0, progress: Progress | None = None) -> Path:
    """Render ``job`` of ``scene`` into its frame folder and return that folder."""
    with ExitStack() as stack:
        if job.frame is not None:
            stack.callback(scene.frame_set, scene.frame_current)
            scene.frame_set(job.frame)
        subject = scene_io.find_subject(scene, job.subject)
        lit = scene_io.has_light(scene)
        if not lit:
            stack.enter_context(overridden(scene, {"world": scene.world}))
            scene_io.add_light(scene)
        stack.enter_context(passes.pass_indices(subject))
        frame = describe(scene, job, subject, lit)
        seconds = _render(scene, job, frame, progress)
    write_frame(job.output, _with_seconds(frame, {"open": opened, "render": seconds}))
    return Path(job.output)


def describe(scene: bpy.types.Scene, job: Job, subject: set[bpy.types.Object], lit: bool = True) -> Frame:
    """The frame that ``job`` asks for, with the array placed in ``scene``."""
    array, matrix_world = rig.place_array(scene, job.display, subject)
    visible = job.world_visible
    if visible is None:
        visible = lit and scene.world is not None and not scene.render.film_transparent
    return Frame(
        display=job.display, scale=job.scale, array=array, matrix_world=matrix_world, samples=job.spp, seed=job.seed,
        frame=scene.frame_current, convention=job.convention, view_aperture=job.view_aperture,
        lens_list=job.lens_list, layout=job.layout, layers=job.layers, world_visible=visible,
        color=color_settings(scene), scene=os.path.basename(job.scene or bpy.data.filepath),
        subject=job.subject or "", blender=bpy.app.version_string, device=job.device)


def color_settings(scene: bpy.types.Scene) -> ColorSettings:
    """How this scene is shown: the names that the second stage needs to look the same."""
    view = scene.view_settings
    config = os.environ.get("OCIO") or str(
        Path(bpy.utils.system_resource("DATAFILES"), "colormanagement", "config.ocio"))
    return ColorSettings(scene.display_settings.display_device, view.view_transform, view.look or "None",
                         view.exposure, view.gamma, config)


def _render(scene: bpy.types.Scene, job: Job, frame: Frame, progress: Progress | None) -> float:
    settings = render.RenderSettings(job.spp, job.seed, job.layers, job.device, job.clamp_indirect,
                                     frame.world_visible)
    return render.render_encoded(scene, frame.rays, frame.matrix_world, settings,
                                 Path(job.output, LOW_RES_FILE), progress)


def _with_seconds(frame: Frame, seconds: dict[str, float]) -> Frame:
    return dataclasses.replace(frame, seconds={name: round(value, 3) for name, value in seconds.items()})
