"""Render a camera array with Cycles into EXR files; every setting is restored afterwards."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path

import bpy
import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.cores import CORES, usable_cores
from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.frame import SUBPIXELS, Clip
from lfsr_core.frames.request import CLAMP_INDIRECT
from lfsr_core.images import exr
from lfsr_core.optics.panel.subpixel_rays import PanelLayout
from lfsr_core.optics.rays import RayLayout
from lfsr_core.pipeline.staging import ImageParts, Part

from .. import compat
from ..scene import devices
from ..scene.array.rig import Matrix, to_blender
from ..scene.overrides import new_data, overridden
from .bands import border, render_in_bands
from .card_camera import card_camera, clip_plane
from .osl_camera import layout_parameters, layout_source, set_shader
from .output import Follow, render_to

LEAST_PIXELS = 4        # Blender renders nothing narrower
NEAR, FAR = 1e-4, 1e4   # clipping, as fractions of the display distance
FOREGROUND, BACKGROUND = 1, 2  # pass indices


@dataclasses.dataclass(frozen=True)
class RenderSettings:
    """How Cycles renders, with any camera."""

    samples: int = 16  # per pixel
    seed: int = 0  # of the random numbers
    layers: tuple[str, ...] = ()  # auxiliary layers besides colour, from ``lfsr_core.frames.request.LAYERS``
    device: str = "CPU"  # or a GPU type such as "OPTIX"
    clamp_indirect: float | None = None  # largest radiance of an indirect path; None: Cycles' default, 0: unclamped
    world_visible: bool = False  # adds the environment pass
    transparent_glass: bool = False  # whether what is behind glass shows through its alpha, as with a transparent film
    half: bool = False  # 16-bit floats instead of 32-bit ones


@dataclasses.dataclass(frozen=True)
class Shot:
    """Which rays a render sends, and from where."""

    layout: RayLayout | PanelLayout  # rays in camera-array space
    matrix_world: Matrix  # camera-array space to the world, four rows of four
    way: str = "one-pass"  # what sends the rays: one of ``lfsr_core.frames.frame.LAYOUTS``
    clip: Clip | None = None  # depths from the camera plane between which things are seen, None for all
    rows: Part | None = None  # rows of pixels of the image to render, None for all

    @property
    def clip_start(self) -> float:
        """Depth at which rays start."""
        return self.clip[0] if self.clip else 0.0

    @property
    def has_card(self) -> bool:
        """Whether a lens card or a panel card sends the rays."""
        return self.way in ("lens-card", SUBPIXELS)

    @property
    def light_field(self) -> RayLayout:
        """The layout, where it is not that of a panel's subpixels."""
        assert isinstance(self.layout, RayLayout)
        return self.layout


def render_encoded(scene: bpy.types.Scene, shot: Shot, settings: RenderSettings, path: str | Path,
                   follow: Follow | None = None, parts: ImageParts | None = None) -> float:
    """Render the rays of ``shot`` in one pass.

    Parameters
    ----------
    scene : the scene, unchanged afterwards
    shot : rays, and from where
    settings : how Cycles renders
    path : multi-layer EXR to write, whole or not at all
    follow : called with (fraction, message) while it renders; an exception that it raises cancels
    parts : caches finished parts of a long render and has those of an earlier run, None for no cache

    Returns
    -------
    Seconds it took.
    """
    ending = clip_plane(scene, shot.layout, shot.matrix_world, shot.clip[1]) if shot.clip else nullcontext(False)
    with encoded_camera(scene, shot), ending as ended, cycles_settings(scene, settings, shot.layout.size):
        height = shot.layout.size[1]
        rows = shot.rows or Part(0, height)
        if parts is not None:
            seconds = render_in_bands(scene, rows, Path(path), follow, parts)
        else:
            with overridden(scene.render, border(rows, height) if rows.size < height else {}):
                seconds = render_to(scene, path, follow)
    if (shot.has_card or ended) and "position" in settings.layers:
        layers = exr.read_layers(path)
        layers["position"] = _without_misses(layers["position"], shot, ended)
        exr.write_layers(path, layers, settings.half)
    return seconds


def _without_misses(position: Array, shot: Shot, ended: bool) -> Array:
    """Position layer (H, W, 3) with 0 where a ray hit nothing; Cycles stores the card or the clip plane there."""
    matrix = np.asarray(shot.matrix_world, float)
    depth = (position - matrix[:3, 3]) @ matrix[:3, 2]
    # The card stands behind the camera plane. Single precision cannot tell what is near to the clip plane from it.
    missed = ~(depth > 0) if shot.has_card else np.zeros(depth.shape, bool)
    if shot.clip and ended:
        missed |= depth > shot.clip[1] * (1 - 1e-5)
    return np.where(missed[..., None], np.float32(0), position)


@contextmanager
def encoded_camera(scene: bpy.types.Scene, shot: Shot) -> Iterator[None]:
    """Make a camera that sends the rays of ``shot`` the scene's camera inside the block."""
    if shot.has_card:
        with card_camera(scene, shot.layout, shot.matrix_world, shot.clip_start):
            yield
        return
    layout = shot.light_field
    with temporary_camera(scene, shot.matrix_world, layout.array.distance) as camera:
        set_shader(camera.data, layout_source(layout), layout_parameters(layout, shot.clip_start))
        yield


@contextmanager
def temporary_camera(scene: bpy.types.Scene, matrix_world: Matrix, distance: float) -> Iterator[bpy.types.Object]:
    """Make a new camera at the array's origin the scene's camera inside the block."""
    with new_data() as made:
        data = bpy.data.cameras.new("LFSR array")
        camera = bpy.data.objects.new("LFSR array", data)
        made += [data, camera]
        camera.matrix_world = to_blender(matrix_world)
        data.clip_start, data.clip_end = distance * NEAR, distance * FAR
        scene.collection.objects.link(camera)
        with overridden(scene, {"camera": camera}):
            yield camera


@contextmanager
def cycles_settings(scene: bpy.types.Scene, settings: RenderSettings, size: tuple[int, int]) -> Iterator[None]:
    """Set up ``scene`` for a Cycles render of ``size`` pixels, with a box filter of one pixel, inside the block."""
    if min(size) < LEAST_PIXELS:
        raise LfsrError(f"the render would be {size[0]}×{size[1]} pixels, but Blender needs at least {LEAST_PIXELS} "
                        "each way: render more lenses or with a smaller scale")
    render = {"engine": "CYCLES", "film_transparent": True, "resolution_x": size[0], "resolution_y": size[1],
              "resolution_percentage": 100, "pixel_aspect_x": 1.0, "pixel_aspect_y": 1.0, "use_border": False,
              "use_crop_to_border": False, "use_multiview": False, "use_motion_blur": False, "use_compositing": False,
              "use_sequencer": False, "use_stamp": False, "use_single_layer": False, "use_freestyle": False,
              "use_file_extension": False, "use_overwrite": True, "use_placeholder": False,
              # Consecutive views and halves have the same geometry.
              "use_persistent_data": True} | compat.whole_textures()
    if CORES in os.environ:  # the cores that this process may use, but no more than the scene asks for
        render |= {"threads_mode": "FIXED", "threads": min(usable_cores(), scene.render.threads)}
    clamp = CLAMP_INDIRECT if settings.clamp_indirect is None else float(settings.clamp_indirect)
    cycles = {"device": "CPU" if settings.device == "CPU" else "GPU", "samples": settings.samples,
              "seed": settings.seed, "use_animated_seed": False, "use_adaptive_sampling": False, "time_limit": 0.0,
              "use_layer_samples": "IGNORE", "use_camera_cull": False, "pixel_filter_type": "BOX",
              "sample_clamp_direct": 0.0, "sample_clamp_indirect": clamp,
              "film_transparent_glass": settings.transparent_glass, "use_denoising": False,
              **compat.whole_sample_range()}
    with (devices.enabled(settings.device), overridden(scene.render, render),
          overridden(scene.render.image_settings, compat.multilayer_exr(settings.half)),
          overridden(scene.cycles, cycles), _passes(scene, settings.layers, settings.world_visible)):
        yield


def pixel_aspect(ratio: float) -> dict[str, float]:
    """Return the render settings for pixels ``ratio`` times as high as wide; one of the two aspects is 1."""
    return {"pixel_aspect_x": max(1.0, 1 / ratio), "pixel_aspect_y": max(1.0, ratio)}


@contextmanager
def _passes(scene: bpy.types.Scene, layers: Sequence[str], environment: bool) -> Iterator[None]:
    """Enable only the passes of ``layers``, on the first view layer that is used for rendering, inside the block."""
    chosen, *others = [layer for layer in scene.view_layers if layer.use] or [scene.view_layers[0]]
    wanted = {"use_pass_combined": True, "use_pass_position": "position" in layers,
              "use_pass_object_index": "index" in layers, "use_pass_environment": environment}
    switches = {name: wanted.get(name, False) for name in _names(chosen) if name.startswith("use_pass_")}
    # Cycles' denoising albedo and normal see through glass.
    own = dict.fromkeys((name for name in _names(chosen.cycles) if name.startswith(("use_pass_", "pass_"))), False)
    own |= {"use_denoising": False, "denoising_store_passes": "albedo" in layers or "normal" in layers}
    with ExitStack() as stack:
        for layer in others:
            stack.enter_context(overridden(layer, {"use": False}))
        stack.enter_context(overridden(chosen, switches | {"use": True, "material_override": None}))
        stack.enter_context(overridden(chosen.cycles, own))
        yield


def _names(owner: bpy.types.bpy_struct) -> list[str]:
    return [item.identifier for item in owner.bl_rna.properties]


@contextmanager
def pass_indices(foreground: set[bpy.types.Object]) -> Iterator[None]:
    """Set the pass index FOREGROUND on ``foreground`` and BACKGROUND on all other objects inside the block."""
    with ExitStack() as stack:
        for item in bpy.data.objects:  # linked ones too: the change is not saved
            index = FOREGROUND if item in foreground else BACKGROUND
            stack.enter_context(overridden(item, {"pass_index": index}))
        yield
