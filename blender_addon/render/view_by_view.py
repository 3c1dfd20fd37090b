"""Render view by view, with one ordinary off-axis camera each: an independent check of the one-pass render.

A pixel of a view sees through one lens (Cycles' box filter) and, as a thin lens with a square aperture focused on
the display plane, over its whole cell of views: in expectation the same image as the one-pass render's.
"""

import math
import tempfile
import time
from pathlib import Path

import bpy
import mathutils
import numpy as np

from lfsr_core.images import image_files
from lfsr_core.optics.rays import from_views, view_offset

from .. import compat
from ..compat import overridden
from ..scene.array.rig import to_blender
from .cycles import RenderSettings, Shot, cycles_settings, pixel_aspect, temporary_camera
from .output import Follow, listed, one_of, render_to, unfinished

SENSOR_MM = 36.0
WINDOW_PER_BOX = 2.08  # width of a Blackman-Harris window with the variance of a box of width 1
THINNEST = 0.01  # least ratio of the sides of an aperture that Blender allows


def render_views(scene: bpy.types.Scene, shot: Shot, settings: RenderSettings, path: str | Path,
                 follow: Follow | None = None) -> float:
    """Render the rays of ``shot`` one view after the other, always whole views; then cut out listed lenses.

    Parameters and result as of ``cycles.render_encoded``; no parts are cached.
    """
    started, layout = time.perf_counter(), shot.light_field
    count, images = layout.views[0] * layout.views[1], list[image_files.Layers]()
    # A pixel has the proportions of a lens.
    ratio = (layout.array.half_height / layout.lenses[1]) / (layout.array.half_width / layout.lenses[0])
    # In the paper's convention a pixel sees only its own part of the lens.
    window = {"pixel_filter_type": "BLACKMAN_HARRIS",
              "filter_width": max(0.01, WINDOW_PER_BOX / max(layout.views))} if layout.convention == "paper" else {}
    with (unfinished(path) as target, temporary_camera(scene, shot.matrix_world, layout.array.distance) as camera,
          cycles_settings(scene, settings, layout.lenses), overridden(scene.render, pixel_aspect(ratio)),
          # EXR files of several parts fail where pixels are not square.
          overridden(scene.render.image_settings, compat.known(scene.render.image_settings, use_exr_interleave=True)),
          overridden(scene.cycles, window),
          tempfile.TemporaryDirectory(prefix=".views-", dir=target.parent) as folder, listed(Path(folder))):
        for number in range(count):
            view = number % layout.views[0], number // layout.views[0]
            aim(camera, shot, view)
            # Each view needs its own random numbers, as each pixel of a one-pass render has.
            scene.cycles.seed = (settings.seed * 65537 + number) % 2**31
            render_to(scene, Path(folder, "view.exr"), one_of(follow, number, count))
            images.append(image_files.read_layers(Path(folder, "view.exr")))
            if "path" in images[-1] and compat.path_from_camera():  # paths of all layouts begin where the clip starts
                across, down = ((np.linspace(1 / lenses - 1, 1 - 1 / lenses, lenses) * half - view_offset(
                    np.array(index), many, layout.spacing, layout.convention)) / layout.array.distance
                                for lenses, half, index, many in zip(layout.lenses, layout.array.half_size, view,
                                                                     layout.views, strict=True))
                clipped = camera.data.clip_start * np.sqrt(1 + across**2 + down[:, None]**2)
                images[-1]["path"] = np.maximum(images[-1]["path"] - clipped[..., None], 0, dtype=np.float32)
        assembled = {}
        for name in images[0]:  # (py, px, sy, sx, C); listed lenses become tiles, row by row
            views = np.stack([layers[name] for layers in images])
            views = views.reshape(*reversed(layout.views), *views.shape[1:])
            if layout.lens_list is not None:
                shown = layout.shown_lenses
                views = views[:, :, shown[..., 0], shown[..., 1]]
            assembled[name] = from_views(views)
        image_files.write_layers(target, assembled, half=settings.half)
    return time.perf_counter() - started


def aim(camera: bpy.types.Object, shot: Shot, view: tuple[int, int]) -> None:
    """Make ``camera`` see the display rectangle from the ``view`` (column, row) of the shot's layout.

    Its aperture is as wide and high as the view's cell and focused on the display plane; without height, a slit.
    """
    layout, array, lens = shot.light_field, shot.layout.array, camera.data
    right, down = (float(view_offset(np.array(index), count, layout.spacing, layout.convention))
                   for index, count in zip(view, layout.views, strict=True))
    lens.type, lens.sensor_fit, lens.sensor_width = "PERSP", "HORIZONTAL", SENSOR_MM
    lens.lens = SENSOR_MM / 2 * array.distance / array.half_width
    lens_right = lens_down = 0.0  # from the centre of a lens: the pixel's own place in the paper's convention
    if layout.convention == "paper":
        lens_right, lens_down = (
            ((index + 0.5) / views - 0.5) * 2 * half / lenses for index, views, half, lenses
            in zip(view, layout.views, (array.half_width, array.half_height), layout.lenses, strict=True))
    lens.shift_x = (lens_right - right) / (2 * array.half_width)
    lens.shift_y = (down - lens_down) / (2 * array.half_width)
    width, height = layout.cell
    lens.dof.use_dof = max(width, height) > 0 and layout.convention != "paper"
    if lens.dof.use_dof:
        lens.dof.focus_object, lens.dof.focus_distance = None, array.distance
        # The ratio narrows a square as high as the cell.
        height = max(height, width * THINNEST)
        lens.dof.aperture_blades, lens.dof.aperture_rotation = 4, 0.0
        lens.dof.aperture_ratio = height / max(width, height * THINNEST)
        # Cycles' aperture radius is lens / (2 · f-stop), with the lens in thousandths of a scene unit; the corners of
        # a square lie on it.
        lens.dof.aperture_fstop = lens.lens * 1e-3 / (height * math.sqrt(2))
    if array.clip:
        lens.clip_start, lens.clip_end = array.clip
    camera.matrix_world = to_blender(shot.matrix_world) @ mathutils.Matrix.Translation((right, -down, 0))
