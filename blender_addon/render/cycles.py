"""Render a camera array with Cycles into EXR files; every setting is restored afterwards."""

import dataclasses
import hashlib
import math
import os
import re
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import CORES, system_errors, usable_cores
from lfsr_core.frames.frame import CLAMP_INDIRECT, SUBPIXELS
from lfsr_core.images import image_files
from lfsr_core.optics.panel.subpixel_rays import PanelLayout
from lfsr_core.optics.rays import RayLayout
from lfsr_core.pipeline.parts import ImageParts, Part

from .. import compat
from ..compat import new_data, overridden
from ..scene.array.rig import Matrix, to_blender
from ..scene.contents import rendered_layer
from .cards import card_camera, clip_plane
from .output import Follow, border, render_in_bands, render_to

LEAST_PIXELS = 4        # Blender renders nothing narrower
NEAR, FAR = 1e-4, 1e4   # clipping, as fractions of the display distance
FOREGROUND, BACKGROUND = 1, 2  # pass indices
SOURCE = Path(__file__).with_name("ray_layout.osl")
ROOM = 10  # times the size of the source that its bytecode has at most


@dataclasses.dataclass(frozen=True)
class RenderSettings:
    """How Cycles renders, with any camera."""

    samples: int = 16  # per pixel
    seed: int = 0  # of the random numbers
    layers: tuple[str, ...] = ()  # auxiliary layers besides colour, from ``lfsr_core.frames.frame.LAYERS``
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
    rows: Part | None = None  # rows of pixels of the image to render, None for all

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
    """Render the rays of ``shot`` in one pass, and return the seconds that it took; ``scene`` is unchanged afterwards.

    ``path``: multi-layer EXR to write, whole or not at all; ``follow``: called with (fraction, message) while it
    renders, an exception that it raises cancels; ``parts``: caches finished parts of a long render and has those of an
    earlier run, None for no cache.
    """
    with (encoded_camera(scene, shot), clip_plane(scene, shot.layout, shot.matrix_world) as end,
          cycles_settings(scene, settings, shot.layout.size)):
        height = shot.layout.size[1]
        rows = shot.rows or Part(0, height)
        if parts is not None:
            seconds = render_in_bands(scene, rows, Path(path), follow, parts)
        else:
            with overridden(scene.render, border(rows, height) if rows.size < height else {}):
                seconds = render_to(scene, path, follow)
    if (shot.has_card or end < math.inf) and "position" in settings.layers:
        # Where a ray hit nothing, Cycles stores the position of the card or of the clip plane: 0 stands for nothing.
        layers, matrix = image_files.read_layers(path), np.asarray(shot.matrix_world, float)
        depth = (layers["position"] - matrix[:3, 3]) @ matrix[:3, 2]
        # The card stands behind the camera plane. In single precision, hits close to the clip plane look like misses.
        missed = ~(depth > 0) if shot.has_card else np.zeros(depth.shape, bool)
        missed |= depth > end * (1 - 1e-5)
        layers["position"] = np.where(missed[..., None], np.float32(0), layers["position"])
        image_files.write_layers(path, layers, settings.half)
    return seconds


@contextmanager
def encoded_camera(scene: bpy.types.Scene, shot: Shot) -> Iterator[None]:
    """Make a camera that sends the rays of ``shot`` the scene's camera inside the block."""
    if shot.has_card:
        with card_camera(scene, shot.layout, shot.matrix_world):
            yield
        return
    layout = shot.light_field
    with temporary_camera(scene, shot.matrix_world, layout.array.distance) as camera:
        set_shader(camera.data, layout_source(layout), layout_parameters(layout))
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
              "use_layer_samples": "IGNORE", "use_camera_cull": False, "use_distance_cull": False,
              "pixel_filter_type": "BOX", "sample_clamp_direct": 0.0, "sample_clamp_indirect": clamp,
              "film_transparent_glass": settings.transparent_glass, "use_denoising": False,
              **compat.known(scene.cycles, use_sample_subset=False)}
    # Only these passes, on the first view layer that is used for rendering.
    layer, layers = rendered_layer(scene), settings.layers
    wanted = {"use_pass_combined": True, "use_pass_position": "position" in layers,
              "use_pass_object_index": "index" in layers, "use_pass_environment": settings.world_visible}
    passes = {item.identifier: wanted.get(item.identifier, False) for item in layer.bl_rna.properties
              if item.identifier.startswith("use_pass_")}
    own = {item.identifier: False for item in layer.cycles.bl_rna.properties
           if item.identifier.startswith(("use_pass_", "pass_"))}
    # Cycles' denoising albedo and normal see through glass.
    own |= {"use_denoising": False, "denoising_store_passes": "albedo" in layers or "normal" in layers}
    with ExitStack() as stack:
        stack.enter_context(compat.device_enabled(settings.device))
        for owner, values in ((scene.render, render),
                              (scene.render.image_settings, compat.multilayer_exr(settings.half)),
                              (scene.cycles, cycles),
                              *((other, {"use": False}) for other in scene.view_layers if other != layer),
                              (layer, compat.known(layer, material_override=None, world_override=None) | passes
                               | {"use": True}), (layer.cycles, own)):
            stack.enter_context(overridden(owner, values))
        yield


def pixel_aspect(ratio: float) -> dict[str, float]:
    """Return the render settings for pixels ``ratio`` times as high as wide; one of the two aspects is 1."""
    return {"pixel_aspect_x": max(1.0, 1 / ratio), "pixel_aspect_y": max(1.0, ratio)}


@contextmanager
def pass_indices(foreground: set[bpy.types.Object]) -> Iterator[None]:
    """Set the pass index FOREGROUND on ``foreground`` and BACKGROUND on all other objects inside the block."""
    with ExitStack() as stack:
        for item in bpy.data.objects:  # linked ones too: the change is not saved
            stack.enter_context(overridden(item, {"pass_index": FOREGROUND if item in foreground else BACKGROUND}))
        yield


def layout_source(layout: RayLayout) -> str:
    """Return the OSL source with the lens list of ``layout`` as constants: parameters of a shader cannot be arrays."""
    source = SOURCE.read_text(encoding="utf-8")
    if layout.lens_list is None:
        return source
    source = re.sub(r"#define LISTED .*", f"#define LISTED {len(layout.lens_list)}", source)
    for name, axis in (("LENS_ROWS", 0), ("LENS_COLUMNS", 1)):
        values = ", ".join(str(lens[axis]) for lens in layout.lens_list)
        source = re.sub(rf"#define {name} .*", f"#define {name} {{ {values} }}", source)
    return source


def layout_parameters(layout: RayLayout) -> dict[str, int | float]:
    """Return the values of the shader's parameters."""
    array = layout.array
    pairs = {"lenses": layout.lenses, "views": layout.views, "tiles": layout.tiles}
    numbers = {f"{name}_{axis}": pair[i] for name, pair in pairs.items() for i, axis in enumerate("xy")}
    return numbers | {"listed": int(layout.lens_list is not None), "paper": int(layout.convention == "paper"),
                      "half_width": float(array.half_width), "half_height": float(array.half_height),
                      "plane_distance": float(array.distance), "spacing": float(layout.spacing),
                      "cell_x": float(layout.cell[0]), "cell_y": float(layout.cell[1]),
                      "clip_start": float(array.clip_start)}


def set_shader(camera: bpy.types.Camera, source: str, parameters: Mapping[str, Any]) -> None:
    """Compile OSL ``source`` for ``camera`` and set its parameters; LfsrError if it does not compile."""
    bytecode = compile_osl(source)
    camera.type = "CUSTOM"
    camera.custom_mode = "INTERNAL"
    # After an error above the camera is as before, with its own bytecode and parameters.
    camera.custom_bytecode = bytecode
    camera.custom_bytecode_hash = hashlib.md5(bytecode.encode(), usedforsecurity=False).hexdigest()
    for name in list(camera.cycles_custom.keys()):
        del camera.cycles_custom[name]
    for name, value in parameters.items():
        camera.cycles_custom[name] = value
    camera.update_tag()


def compile_osl(source: str) -> str:
    """Return the bytecode of OSL ``source``; LfsrError if this Blender has no OSL or rejects it."""
    advice = "the OSL camera is not available ({}): render with the layout lens-card"
    if not compat.has_osl():
        raise LfsrError(advice.format("this Blender was built without OSL"))
    import _cycles

    # In Blender's own temporary folder, which is removed even if Blender crashes.
    with tempfile.TemporaryDirectory(prefix="lfsr-osl-", dir=bpy.app.tempdir or None) as folder:
        text, code = Path(folder, "camera.osl"), Path(folder, "camera.oso")
        with system_errors(text.parent):
            text.write_text(source, encoding="utf-8")
            if not _cycles.osl_compile(str(text), str(code)) or not code.is_file() or not code.stat().st_size:
                code.write_bytes(bytes(ROOM * text.stat().st_size))  # fails where there was no room for the bytecode
                raise LfsrError(advice.format("Cycles rejected the ray-layout shader, see its message above"))
        # Cycles reads no " in paths, and no line break in the comment with the options.
        return re.sub(r'(?s)# options:.*?\n(?=shader )|(%filename\{".*?"\} )?%line\{\d+\}', "", code.read_text("utf-8"))
