"""Cycles renders of a camera array into EXR files; every setting restored after."""

from __future__ import annotations

import dataclasses
import functools
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from pathlib import Path

import bpy

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.files import atomic_path
from lfsr_core.frames.frame import SUBPIXELS, Clip
from lfsr_core.frames.job import CLAMP_INDIRECT
from lfsr_core.images import exr
from lfsr_core.optics.panel.panel_rays import PanelLayout
from lfsr_core.optics.rays import RayLayout
from lfsr_core.render.parts import ImageParts, Part

from .. import compat
from ..array.spaces import Matrix, to_blender
from . import devices, passes
from .bands import Target, border, render_in_bands
from .curtain import curtain, without_places
from .lens_card import card_camera, without_misses
from .osl_camera import set_ray_layout
from .overrides import overridden
from .panel_camera import set_panel_layout
from .progress import Progress, following

LEAST_PIXELS = 4        # Blender renders nothing narrower
NEAR, FAR = 1e-4, 1e4   # clipping, as shares of the display distance
# Files and folders that a render is writing now; a process that must die at once removes them.
UNFINISHED: set[Path] = set()


@dataclasses.dataclass(frozen=True)
class RenderSettings:
    """How Cycles renders, whatever the camera."""

    # Paths per pixel.
    samples: int = 16
    # Of the random numbers.
    seed: int = 0
    # Auxiliary layers besides colour, from ``lfsr_core.frames.job.LAYERS``.
    layers: tuple[str, ...] = ()
    # "CPU" or a GPU type such as "OPTIX".
    device: str = "CPU"
    # Largest radiance of an indirect path; None: Cycles' default, 0: unclamped.
    clamp_indirect: float | None = None
    # Adds the environment pass.
    world_visible: bool = False
    # Writes 16-bit floats instead of 32-bit ones.
    half: bool = False

    def __post_init__(self) -> None:
        if self.samples < 1:
            raise LfsrError(f"samples per pixel is {self.samples}, but it must be at least 1")
        passes.check_layers(self.layers)


@dataclasses.dataclass(frozen=True)
class Shot:
    """Which rays a render sends, and from where."""

    # Rays in camera-array space.
    layout: RayLayout | PanelLayout
    # Camera-array space to the world, four rows of four.
    matrix_world: Matrix
    # Who sends them in one pass: "one-pass", "subpixels" (an OSL camera, of a PanelLayout) or "lens-card".
    way: str = "one-pass"
    # Depths from the camera plane between which things are seen; None: all.
    clip: Clip | None = None

    # Rows of pixels of the image to render; None for all.
    rows: Part | None = None

    @property
    def clip_start(self) -> float:
        """Depth at which rays start."""
        return self.clip[0] if self.clip else 0.0


@dataclasses.dataclass(frozen=True)
class Following:
    """What goes along with a render that may take long."""

    # Called while it renders; an exception it raises cancels.
    progress: Progress | None = None
    # Keeps what is whole of it; None keeps nothing.
    parts: ImageParts | None = None


ALONE = Following()


def render_encoded(scene: bpy.types.Scene, shot: Shot, settings: RenderSettings, path: str | Path,
                   along: Following = ALONE) -> float:
    """Render the rays of ``shot`` in one pass.

    Parameters
    ----------
    scene : the scene, unchanged afterwards
    shot : rays, and from where
    settings : how Cycles renders
    path : multi-layer EXR to write, whole or not at all
    along : hears of it, and keeps its parts

    Returns
    -------
    Seconds it took.
    """
    with (encoded_camera(scene, shot), _ended(scene, shot) as ended,
          cycles_settings(scene, settings, shot.layout.size)):
        # A denoiser would see the edges of bands.
        along = dataclasses.replace(along, parts=None) if "denoised" in settings.layers else along
        seconds = render_kept(scene, shot.rows or Part(0, shot.layout.size[1]), path, along)
    if (shot.way == "lens-card" or ended) and "position" in settings.layers:
        layers = exr.read_layers(path)
        layers["position"] = _without_misses(layers["position"], shot, bool(ended))
        exr.write_layers(path, layers, settings.half)
    return seconds


def _ended(scene: bpy.types.Scene, shot: Shot) -> AbstractContextManager[bool | None]:
    """Inside the block nothing is seen beyond the shot's clipped depths; True if anything lies there."""
    return curtain(scene, shot.layout, shot.matrix_world, shot.clip[1]) if shot.clip else nullcontext()


def _without_misses(position: Array, shot: Shot, ended: bool) -> Array:
    if shot.way == "lens-card":
        position = without_misses(position, shot.matrix_world)
    return without_places(position, shot.matrix_world, shot.clip[1]) if ended else position


@contextmanager
def encoded_camera(scene: bpy.types.Scene, shot: Shot) -> Iterator[None]:
    """Inside the block the scene's camera sends the rays of ``shot``."""
    if shot.way == "lens-card":
        with card_camera(scene, shot.layout, shot.matrix_world, shot.clip_start):
            yield
        return
    with temporary_camera(scene, shot.matrix_world, shot.layout.array.distance) as camera:
        set_rays = set_panel_layout if shot.way == SUBPIXELS else set_ray_layout
        set_rays(camera.data, shot.layout, shot.clip_start)
        yield


def render_kept(scene: bpy.types.Scene, rows: Part, path: str | Path, along: Following = ALONE) -> float:
    """``render_to`` of ``rows``; a long one goes on where an earlier one ended, if parts are kept; seconds of both."""
    if along.parts is not None:
        return render_in_bands(functools.partial(render_to, scene), Target(scene, rows, Path(path)), along.progress,
                               along.parts)
    shown = border(rows, scene.render.resolution_y) if rows.size < scene.render.resolution_y else {}
    with overridden(scene.render, shown):
        return render_to(scene, path, along.progress)


def render_to(scene: bpy.types.Scene, path: str | Path, progress: Progress | None = None) -> float:
    """Render the scene as it is set up now into ``path``, whole or not at all; seconds."""
    started = time.perf_counter()
    with unfinished(path) as temporary, overridden(scene.render, {"filepath": compat.literal_path(str(temporary))}):
        temporary.unlink()
        try:
            with following(progress):
                bpy.ops.render.render(write_still=True, scene=scene.name)
        except RuntimeError as error:
            raise LfsrError(f"Blender cannot render this scene ({str(error).strip()}): see its messages") from None
        if not temporary.is_file():
            raise LfsrError(f"Blender wrote no image for {path}: see its messages")
        exr.check_complete(temporary)
    return time.perf_counter() - started


@contextmanager
def unfinished(path: str | Path) -> Iterator[Path]:
    """``atomic_path``, known to a process that must die at once."""
    with atomic_path(path) as temporary:
        UNFINISHED.add(temporary)
        try:
            yield temporary
        finally:
            UNFINISHED.discard(temporary)


@contextmanager
def temporary_camera(scene: bpy.types.Scene, matrix_world: Matrix, distance: float) -> Iterator[bpy.types.Object]:
    """Camera at the array's origin, made the scene's camera inside the block and removed after it."""
    data = bpy.data.cameras.new("LFSR array")
    camera = bpy.data.objects.new("LFSR array", data)
    try:
        camera.matrix_world = to_blender(matrix_world)
        data.clip_start, data.clip_end = distance * NEAR, distance * FAR
        scene.collection.objects.link(camera)
        with overridden(scene, {"camera": camera}):
            yield camera
    finally:
        bpy.data.objects.remove(camera)
        bpy.data.cameras.remove(data)


@contextmanager
def cycles_settings(scene: bpy.types.Scene, settings: RenderSettings, size: tuple[int, int]) -> Iterator[None]:
    """Scene settings for an unfiltered, undenoised Cycles render of ``size`` pixels, restored after the block."""
    if min(size) < LEAST_PIXELS:
        raise LfsrError(f"the render would be {size[0]}×{size[1]} pixels, but Blender needs at least {LEAST_PIXELS} "
                        "each way: render more lenses or with a smaller scale")
    with ExitStack() as stack:
        stack.enter_context(devices.enabled(settings.device))
        stack.enter_context(overridden(scene.render, _render_values(size)))
        stack.enter_context(overridden(scene.render.image_settings, compat.multilayer_exr(settings.half)))
        stack.enter_context(overridden(scene.cycles, _cycles_values(settings)))
        stack.enter_context(passes.enabled(scene, settings.layers, settings.world_visible))
        yield


def _render_values(size: tuple[int, int]) -> dict[str, object]:
    return {"engine": "CYCLES", "film_transparent": True, "resolution_x": size[0], "resolution_y": size[1],
            "resolution_percentage": 100, "pixel_aspect_x": 1.0, "pixel_aspect_y": 1.0, "use_border": False,
            "use_crop_to_border": False, "use_multiview": False, "use_motion_blur": False, "use_compositing": False,
            "use_sequencer": False, "use_stamp": False, "use_single_layer": False, "use_freestyle": False,
            "use_file_extension": False, "use_overwrite": True, "use_placeholder": False,
            # Views and halves follow each other with the same geometry.
            "use_persistent_data": True} | compat.whole_textures()


def _cycles_values(settings: RenderSettings) -> dict[str, object]:
    clamp = CLAMP_INDIRECT if settings.clamp_indirect is None else float(settings.clamp_indirect)
    return {"device": "CPU" if settings.device == "CPU" else "GPU", "samples": settings.samples,
            "seed": settings.seed, "use_animated_seed": False,
            "use_adaptive_sampling": False, "time_limit": 0.0,
            "use_layer_samples": "IGNORE", "use_camera_cull": False,
            "pixel_filter_type": "BOX", "sample_clamp_direct": 0.0,
            "sample_clamp_indirect": clamp, "film_transparent_glass": False,
            **_denoiser(settings), **compat.whole_sample_range()}


def _denoiser(settings: RenderSettings) -> dict[str, object]:
    """Cycles' own denoiser for the layer "denoised": colour alone, as the method "oidn"."""
    if "denoised" not in settings.layers:
        return {"use_denoising": False}
    if not devices.has_denoiser():
        raise LfsrError("the layer denoised needs Open Image Denoise, which this Blender was built without: "
                        "choose the method 'oidn', or another Blender")
    return {"use_denoising": True, "denoiser": "OPENIMAGEDENOISE", "denoising_input_passes": "RGB",
            "denoising_prefilter": "NONE", "denoising_quality": "HIGH",
            "denoising_use_gpu": settings.device != "CPU"}
