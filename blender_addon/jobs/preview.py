"""Show the view that an eye in the viewing zone sees, in the Image Editor.

The second stage writes all decoded views of a finished image to one file. The file
is mapped while a view is read, so that showing one reads a few kB and follows a slider;
only then, because Windows replaces no mapped file.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError

from . import show_image

IMAGE_NAME = "Light Field View"
LEAST_WIDTH = 480  # in pixels; smaller views are enlarged by repeating pixels
_files: dict[str, Path] = {}  # of the views (py, px, sy, sx, 3) of each scene


def load(scene: bpy.types.Scene, path: Path) -> None:
    """Preview the decoded views in ``path`` for ``scene``; LfsrError where they cannot be read."""
    try:
        _mapped(path)
        _files[scene.name_full] = path
    except (OSError, ValueError) as error:
        raise LfsrError(f"decoded views {path} cannot be read ({error}): press Preview View again") from None


def unload(scene: bpy.types.Scene) -> None:
    """Forget the views of ``scene``."""
    _files.pop(scene.name_full, None)


def is_loaded(scene: bpy.types.Scene) -> bool:
    """True if there are views of ``scene`` for its sliders to show."""
    return scene.name_full in _files


@bpy.app.handlers.persistent
def forget(*_: object) -> None:
    """Forget all views, as when another file is opened."""
    _files.clear()


def show(scene: bpy.types.Scene, eye: tuple[float, float]) -> bpy.types.Image | None:
    """Put the view from ``eye`` (right, up), in [-1, 1], into the preview image; None if no views are loaded."""
    if scene.name_full not in _files:
        return None
    views = _mapped(_files[scene.name_full])
    pixels = to_pixels(views[view_index(views.shape[:2], eye)])
    image = _image(pixels.shape[1], pixels.shape[0])
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    image.pack()  # an image that is modified keeps Blender from quitting without a question
    for area in show_image.areas("IMAGE_EDITOR"):
        area.tag_redraw()  # an editor does not notice that its image has changed
    return image


def view_index(count: Sequence[int], eye: tuple[float, float]) -> tuple[int, int]:
    """(row, column) of the view nearest to ``eye`` among ``count`` (py, px); row 0 is the topmost camera."""
    row, column = int((1 - eye[1]) / 2 * count[0]), int((eye[0] + 1) / 2 * count[1])
    return min(max(row, 0), count[0] - 1), min(max(column, 0), count[1] - 1)


def to_pixels(view: Array) -> Array:
    """Convert (sy, sx, 3) uint8, top row first, to Blender's (height, width, 4) float32, bottom row first; enlarge."""
    times = max(1, -(-LEAST_WIDTH // view.shape[1]))
    pixels = np.ones((*view.shape[:2], 4), np.float32)
    np.multiply(view[::-1], np.float32(1 / 255), out=pixels[..., :3])
    return pixels.repeat(times, axis=0).repeat(times, axis=1)


def _mapped(path: Path) -> Array:
    return np.load(path, mmap_mode="r")


def _image(width: int, height: int) -> bpy.types.Image:
    image = bpy.data.images.get(IMAGE_NAME)
    if image is None or image.source not in {"GENERATED", "FILE"} or image.filepath:  # not ours
        return bpy.data.images.new(IMAGE_NAME, width, height)
    if tuple(image.size) != (width, height):
        image.scale(width, height)
    return image


unregister = forget
HANDLERS = (("load_post", forget),)
