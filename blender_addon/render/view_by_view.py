"""Render view by view, with one ordinary off-axis camera each: for devices without OSL, and as an independent check.

A pixel of a view sees through one lens (Cycles' box filter) and, as a thin lens with a square aperture focused on
the display plane, over its whole cell of views: in expectation the same image as the one-pass render's.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import mathutils
import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.images import exr
from lfsr_core.optics import eia
from lfsr_core.optics.rays import RayLayout, view_offset
from lfsr_core.pipeline.parts import ImageParts, Part, is_worth_storing, seconds_per_part

from .. import compat
from ..scene.array.spaces import to_blender
from ..scene.overrides import overridden
from .cycles import RenderSettings, Shot, cycles_settings, pixel_aspect, temporary_camera
from .output import Follow, listed, one_of, render_to, unfinished

SENSOR_MM = 36.0
WINDOW_PER_BOX = 2.08  # width of a Blackman-Harris window with the variance of a box of width 1
THINNEST = 0.01  # least ratio of the sides of an aperture that Blender allows


def render_views(scene: bpy.types.Scene, shot: Shot, settings: RenderSettings, path: str | Path,
                 follow: Follow | None = None, parts: ImageParts | None = None) -> float:
    """Render the rays of ``shot`` one view after the other, always whole views; then cut out listed lenses.

    Parameters and result as of ``cycles.render_encoded``.
    """
    started, layout = time.perf_counter(), shot.light_field
    # A pixel has the proportions of a lens.
    ratio = (layout.array.half_height / layout.lenses[1]) / (layout.array.half_width / layout.lenses[0])
    views = _Views(layout.views[0] * layout.views[1], Path(path).with_name("views.exr"), parts)
    with (unfinished(path) as target, temporary_camera(scene, shot.matrix_world, layout.array.distance) as camera,
          cycles_settings(scene, settings, layout.lenses), overridden(scene.render, pixel_aspect(ratio)),
          overridden(scene.render.image_settings, compat.one_part_exr()),
          overridden(scene.cycles, _filter(layout)), _folder(target.parent) as folder):
        for number in range(views.count):
            if number in views.images:
                continue
            aim(camera, shot, (number % layout.views[0], number // layout.views[0]))
            # Each view needs its own random numbers, as each pixel of a one-pass render has.
            scene.cycles.seed = (settings.seed * 65537 + number) % 2**31
            render_to(scene, folder / "view.exr", one_of(follow, number, views.count))
            views.add(number, exr.read_layers(folder / "view.exr"))
        views.end()
        layers = {name: assemble(layout, [views.images[number][name] for number in range(views.count)])
                  for name in views.images[0]}
        exr.write_layers(target, layers, half=settings.half)
    return time.perf_counter() - started + views.seconds_before


class _Views:
    """Views of one image, row by row of the array; with ``parts`` each minute's work is cached."""

    def __init__(self, count: int, working: Path, parts: ImageParts | None) -> None:
        """``count`` views, cached in ``parts`` by way of the file ``working``."""
        self.count, self._working, self._parts = count, working, parts
        self.images: dict[int, exr.Layers] = {}
        self._new: list[int] = []
        self._since = time.perf_counter()
        cached = parts.stored(count) if parts else []
        self.seconds_before = sum(group.seconds for group, _ in cached)
        for group, path in cached:
            split = {name: np.split(pixels, group.size) for name, pixels in exr.read_layers(path).items()}
            for index in range(group.size):
                self.images[group.first + index] = {name: images[index] for name, images in split.items()}

    def add(self, number: int, layers: exr.Layers) -> None:
        """Add a view; consecutive views are cached together."""
        if self._new and self._new[-1] != number - 1:
            self._keep()
        self.images[number] = layers
        self._new.append(number)
        if time.perf_counter() - self._since >= seconds_per_part():
            self._keep()

    def end(self) -> None:
        """Cache the last views if another image follows."""
        lasting = self._parts is not None and self._parts.another_follows
        if lasting and self._new and is_worth_storing(time.perf_counter() - self._since):
            self._keep()

    def _keep(self) -> None:
        if self._parts is not None:
            now, group = time.perf_counter(), [self.images[number] for number in self._new]
            exr.write_layers(self._working, {name: np.concatenate([layers[name] for layers in group])
                                             for name in group[0]})
            self._parts.store(self._working, Part(self._new[0], self._new[-1] + 1, now - self._since))
        self._new, self._since = [], time.perf_counter()


@contextmanager
def _folder(parent: Path) -> Iterator[Path]:
    """Temporary folder for one view at a time, on the disk of the output."""
    with tempfile.TemporaryDirectory(prefix=".views-", dir=parent) as name, listed(Path(name)):
        yield Path(name)


def aim(camera: bpy.types.Object, shot: Shot, view: tuple[int, int]) -> None:
    """Make ``camera`` see the display rectangle from the ``view`` (column, row) of the shot's layout."""
    layout, array, lens = shot.light_field, shot.layout.array, camera.data
    right, down = (float(view_offset(np.array(index), count, layout.spacing, layout.convention))
                   for index, count in zip(view, layout.views, strict=True))
    lens.type, lens.sensor_fit, lens.sensor_width = "PERSP", "HORIZONTAL", SENSOR_MM
    lens.lens = SENSOR_MM / 2 * array.distance / array.half_width
    lens_right, lens_down = _place_in_lens(layout, view)
    lens.shift_x = (lens_right - right) / (2 * array.half_width)
    lens.shift_y = (down - lens_down) / (2 * array.half_width)
    open_aperture(lens, layout)
    if shot.clip:
        lens.clip_start, lens.clip_end = shot.clip
    camera.matrix_world = to_blender(shot.matrix_world) @ mathutils.Matrix.Translation((right, -down, 0))


def open_aperture(camera: bpy.types.Camera, layout: RayLayout) -> None:
    """Open an aperture as wide and high as the view's cell, focused on the display plane; without height: a slit."""
    width, height = layout.cell
    camera.dof.use_dof = max(width, height) > 0 and layout.convention != "paper"
    if not camera.dof.use_dof:
        return
    camera.dof.focus_object, camera.dof.focus_distance = None, layout.array.distance
    # The ratio narrows a square as high as the cell.
    height = max(height, width * THINNEST)
    camera.dof.aperture_blades, camera.dof.aperture_rotation = 4, 0.0
    camera.dof.aperture_ratio = height / max(width, height * THINNEST)
    # Cycles' aperture radius is lens / (2 · f-stop), with the lens in thousandths of a scene unit; the corners of a
    # square lie on it.
    camera.dof.aperture_fstop = camera.lens * 1e-3 / (height * math.sqrt(2))


def assemble(layout: RayLayout, views: list[Array]) -> Array:
    """Return the layout's image (H, W, C) of its views (sy, sx, C), row by row; listed lenses become tiles."""
    px, py = layout.views
    stacked = np.stack(views).reshape(py, px, *views[0].shape)
    if layout.lens_list is not None:
        listed = np.asarray(layout.lens_list)
        across, down = layout.tiles
        listed = listed[np.minimum(np.arange(across * down), len(listed) - 1)].reshape(down, across, 2)
        stacked = stacked[:, :, listed[..., 0], listed[..., 1]]
    return eia.from_views(stacked)


def _place_in_lens(layout: RayLayout, view: tuple[int, int]) -> tuple[float, float]:
    """Offset on the display plane from the lens centre: 0, but the pixel's own in the paper's convention."""
    if layout.convention != "paper":
        return 0.0, 0.0
    halves = (layout.array.half_width, layout.array.half_height)
    right, down = (((index + 0.5) / views - 0.5) * 2 * half / lenses for index, views, half, lenses
                   in zip(view, layout.views, halves, layout.lenses, strict=True))
    return right, down


def _filter(layout: RayLayout) -> dict[str, object]:
    """No change to the box filter, but in the paper's convention a pixel sees only its own part of the lens."""
    if layout.convention != "paper":
        return {}
    return {"pixel_filter_type": "BLACKMAN_HARRIS", "filter_width": max(0.01, WINDOW_PER_BOX / max(layout.views))}
