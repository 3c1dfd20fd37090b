"""Render a job into its frame folder: place the array, render, write ``frame.json``."""

from __future__ import annotations

import dataclasses
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice
from lfsr_core.frames.frame import LOW_RES_FILE, REFERENCE_FILES, SUBPIXELS, WORLD_FILE, Frame, write_frame
from lfsr_core.frames.low_res import finished_layout
from lfsr_core.frames.request import AUTO, GUIDES, OWN, Request
from lfsr_core.optics.lens_rows import pixel_rows
from lfsr_core.optics.world_view import WorldImage
from lfsr_core.pipeline.parts import ImageParts, Part, remove_others

from ..scene import devices
from ..scene.array import motion, placement
from ..scene.array.scale import scale_of
from ..scene.color import color_settings
from ..scene.light import lit
from ..scene.subject import find_subject, has_background_meshes
from . import animation, passes, world
from .arrival import chosen_light
from .cycles import RenderSettings, Shot, render_encoded
from .inputs import Opened, inputs
from .output import unfinished
from .progress import Progress, one_of
from .view_by_view import render_views

# Added to a reference half's seed, so that no half has the random numbers of a candidate image.
HALF_SEED = 1 << 20
Warn = Callable[[str], None]


def render_job(scene: bpy.types.Scene, job: Request, opened: Opened | None = None, progress: Progress | None = None,
               warn: Warn = print) -> Path:
    """Render ``job`` into its frame folder; the scene is unchanged afterwards, also after an error.

    Parameters
    ----------
    scene : the scene to render
    job : what to render of it, and into which folder
    opened : how the scene was opened; without its file's content no parts of a long render are cached
    progress : called with (fraction, message); an exception that it raises cancels
    warn : called with sentences for the user

    Returns
    -------
    The frame folder.
    """
    opened = opened or Opened()
    job = dataclasses.replace(job, device=devices.resolved(job.device),
                              light=opened.light if job.light == AUTO else job.light)
    notes = list(opened.notes)

    def note(sentence: str) -> None:
        notes.append(sentence)
        warn(sentence)

    with prepared(scene, job, note) as frame:
        known = _inputs(scene, job, frame, opened, warn)
        seconds = {"open": opened.seconds}
        if frame.world_apart:
            seconds["world"] = _world_image(scene, job, frame)
        with world.white_to_camera(scene) if frame.world_apart else nullcontext():
            seconds["render"] = seconds.get("world", 0.0) + _render(scene, job, frame, known, progress)
    seconds = {name: round(value, 3) for name, value in seconds.items()}
    write_frame(job.output, dataclasses.replace(frame, content=opened.content, seconds=seconds,
                                                notes=tuple(Notice("render-note", {"text": text}) for text in notes)))
    return Path(job.output)


@contextmanager
def prepared(scene: bpy.types.Scene, job: Request, warn: Warn = print) -> Iterator[Frame]:
    """Set ``scene`` to the job's frame, light it and index its objects inside the block; yield the Frame."""
    # Not at the job's frame: all frames of an animation have the same light.
    job = dataclasses.replace(job, light=settled_light(scene, job, warn))
    with motion.same_frame(scene):
        if job.frame is not None:
            scene.frame_set(job.frame)
        if job.sampling.scales and job.kind != "reference":
            job = job.with_scale(scale_of(scene, job))
        subject = find_subject(scene, job.subject)
        with animation.resting(scene), passes.pass_indices(subject), lit(scene, job.light):
            frame = _frame(scene, job, subject)
            placed = frame.array, frame.matrix_world
            for sentence in filter(None, (placement.focus_notice(scene, placed),
                                          placement.unseen_notice(scene, job.display, placed, subject))):
                warn(sentence)
            yield dataclasses.replace(frame, world_apart=_world_apart(scene, frame, job, warn))


def settled_light(scene: bpy.types.Scene, job: Request, warn: Warn) -> str:
    """Return the light of ``scene`` for ``job``: the one asked for, or for AUTO the one that the scene needs now."""
    if job.light != AUTO:
        return job.light
    with animation.resting(scene):
        return chosen_light(scene, job, warn)


def _frame(scene: bpy.types.Scene, job: Request, subject: set[bpy.types.Object]) -> Frame:
    """The frame that ``job`` asks for; LfsrError if the array cannot be placed or colours cannot be reproduced."""
    array, matrix_world = placement.place_array(scene, job.display, subject)
    layers = tuple(dict.fromkeys((*job.layers, *(GUIDES if _has_guides(job) else ()))))
    world_visible = _world_visible(scene, job)
    if "index" not in layers and has_background_meshes(scene, subject):
        layers = (*layers, "index")
    # The lens card renders where the OSL camera cannot.
    layout = devices.way_of(job.device) if job.layout == "one-pass" else job.layout
    return Frame(
        display=job.display, scale=1 if job.kind == "reference" else job.sampling.scale,
        scale_reason=job.sampling.reason,
        array=array, matrix_world=matrix_world, samples=job.sampling.samples, seed=job.seed, frame=scene.frame_current,
        convention=job.convention, view_aperture=job.view_aperture, lens_list=job.lens_list, rows=job.rows,
        layout=layout, layers=layers, clip=placement.clip_of(scene), world_visible=world_visible,
        color=color_settings(scene, world_visible), scene=os.path.basename(job.scene or bpy.data.filepath),
        scene_name=job.scene_name or scene.name_full, source=job.source, subject=job.subject or "",
        camera=job.camera or "", light=job.light, blender=bpy.app.version_string, device=job.device,
        gpus=devices.gpu_addresses(job.device))


def _has_guides(job: Request) -> bool:
    """Whether the denoiser is given more than colours; every view at scale 1 would take as much memory again."""
    return job.kind == "render" and job.sampling.scale > 1 and job.layout != SUBPIXELS


def _world_visible(scene: bpy.types.Scene, job: Request) -> bool:
    if job.world_visible and scene.world is None:
        raise LfsrError(f"scene {scene.name!r} has no world to show behind the subject: add a world, or leave out "
                        "--world-visible")
    if job.world_visible is not None:
        return job.world_visible
    return job.light == OWN and scene.world is not None and not scene.render.film_transparent


def _world_apart(scene: bpy.types.Scene, frame: Frame, job: Request, warn: Warn) -> bool:
    """True if the visible world is rendered separately; ``warn`` if it cannot be."""
    if not frame.world_visible or job.kind != "render" or frame.scale == 1:
        return False
    reason = world.reason_against(scene)
    if reason:
        warn(f"{reason}, so the world is rendered with the subject and is less sharp")
    return not reason


def _world_image(scene: bpy.types.Scene, job: Request, frame: Frame) -> float:
    """Write the image of the world alone into the job's folder; seconds of rendering it."""
    path = Path(job.output, WORLD_FILE)
    if job.world is not None:
        with unfinished(path) as temporary:
            shutil.copyfile(job.world, temporary)
        return 0.0
    settings = RenderSettings(world.SAMPLES, frame.seed, device=job.device)
    image = WorldImage.of(finished_layout(frame))
    return world.render_world(scene, image, frame.matrix_world, settings, path)


def _images(scene: bpy.types.Scene, job: Request, frame: Frame) -> list[tuple[str, RenderSettings]]:
    """File and settings of every image to render: one, or a reference's two halves."""
    see_through = scene.render.film_transparent and scene.cycles.film_transparent_glass and not frame.world_visible
    settings = RenderSettings(frame.samples, job.seed, frame.layers, job.device, job.clamp_indirect,
                              frame.world_visible, see_through)
    if job.kind != "reference":
        return [(LOW_RES_FILE, settings)]
    # Unclamped unless the job clamps: clamping would bias a reference.
    settings = dataclasses.replace(settings, clamp_indirect=job.clamp_indirect or 0.0,
                                   half="position" not in frame.layers)
    return [(name, dataclasses.replace(settings, samples=(job.sampling.samples + 1 - half) // 2,
                                       seed=(job.seed + HALF_SEED * (half + 1)) % 2**31))
            for half, name in enumerate(REFERENCE_FILES)]


def _inputs(scene: bpy.types.Scene, job: Request, frame: Frame, opened: Opened, warn: Warn) -> dict[str, str] | None:
    """Inputs of the render; None if none of its parts are cached. Removes cached parts of other inputs."""
    if not job.parts or not opened.content:
        return None
    known = inputs(scene, job, frame, opened.content)
    sentence = remove_others(Path(job.parts), known)
    if sentence:
        warn(sentence)
    return known


def _render(scene: bpy.types.Scene, job: Request, frame: Frame, known: dict[str, str] | None,
            progress: Progress | None) -> float:
    """Render every image of the job; seconds."""
    render = render_views if frame.layout == "view-by-view" else render_encoded
    images, seconds = _images(scene, job, frame), 0.0
    rows = None if frame.rows is None else Part(*pixel_rows(frame.rows, frame.rays.views[1]))
    shot = Shot(frame.panel_rays or frame.rays, frame.matrix_world, frame.layout, frame.clip, rows)
    for number, (name, settings) in enumerate(images):
        parts = ImageParts(Path(job.parts or ""), Path(name).stem, known,
                           another_follows=number + 1 < len(images)) if known else None
        seconds += render(scene, shot, settings, Path(job.output, name), one_of(progress, number, len(images)), parts)
    return seconds
