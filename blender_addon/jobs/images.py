"""Show images: the view that an eye sees in the panel, and any in an Image Editor that is open.

No editor is opened over the artist's work unasked. The second stage writes all decoded views of a finished image to one
file. It is memory-mapped while a view is read, so that showing a view reads a few kB and follows a slider; only then,
because Windows cannot replace a mapped file.
"""

from collections.abc import Sequence
from pathlib import Path

import bpy
import bpy.utils.previews
import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError

OWN = "lfsr_image"  # property of images that we have loaded: the file need not keep them
IMAGE_NAME = "Light Field View"
LEAST_WIDTH = 480  # in pixels; smaller views are enlarged by repeating pixels
_files: dict[str, Path] = {}  # of the views (py, px, sy, sx, 3) of each scene
_icons: bpy.utils.previews.ImagePreviewCollection | None = None  # what the panel draws, by scene


def load(scene: bpy.types.Scene, path: Path) -> None:
    """Preview the decoded views in ``path`` for ``scene``; LfsrError where they cannot be read."""
    try:
        np.load(path, mmap_mode="r")
        _files[scene.name_full] = path
    except (OSError, ValueError) as error:
        raise LfsrError(f"decoded views {path} cannot be read ({error}): press Preview View again") from None


def unload(scene_name: str) -> None:
    """Forget the views of a scene."""
    _files.pop(scene_name, None)
    if _icons is not None:
        _icons.pop(scene_name, None)


def icon(scene: bpy.types.Scene) -> int:
    """Return the number of the icon that shows the view of ``scene``, 0 where there is none."""
    return _icons[scene.name_full].icon_id if _icons is not None and scene.name_full in _icons else 0


@bpy.app.handlers.persistent
def forget(*_: object) -> None:
    """Forget all views, as when another file is opened."""
    _files.clear()
    if _icons is not None:
        _icons.clear()


def show(scene: bpy.types.Scene, eye: tuple[float, float]) -> bpy.types.Image | None:
    """Show the view from ``eye`` (right, up), in [-1, 1], and return its image; None if no views are loaded."""
    if scene.name_full not in _files:
        return None
    views = np.load(_files[scene.name_full], mmap_mode="r")
    pixels = to_pixels(views[view_index(views.shape[:2], eye)])
    if _icons is not None:
        shown = _icons.get(scene.name_full) or _icons.new(scene.name_full)
        shown.image_size = pixels.shape[1::-1]
        shown.image_pixels_float.foreach_set(pixels.ravel())
    image, size = bpy.data.images.get(IMAGE_NAME), (pixels.shape[1], pixels.shape[0])
    if image is None or OWN not in image:
        image = bpy.data.images.new(IMAGE_NAME, *size)
        image[OWN] = True
    if tuple(image.size) != size:
        image.scale(*size)
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    image.pack()  # an image that is modified keeps Blender from quitting without a question
    redraw("IMAGE_EDITOR")  # an editor does not notice that its image has changed
    redraw_sidebars()
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


def open_file(path: Path, opens_window: bool = False) -> bpy.types.Image:
    """Load ``path``, or reload it, and show it."""
    image = next((image for image in bpy.data.images if bpy.path.abspath(image.filepath) == str(path)), None)
    if image is not None:
        image.reload()
    else:
        image = bpy.data.images.load(str(path))
        image[OWN] = True
    image.name = f"{path.parent.parent.name} {path.parent.name} {path.stem}"
    in_editor(image, opens_window)
    return image


def in_editor(image: bpy.types.Image | None, opens_window: bool = False) -> None:
    """Show ``image`` in an Image Editor that is open, else in a new one if ``opens_window``; background has none."""
    if image is None or bpy.app.background:
        return
    # The UV Editor is of the same type.
    area = next((area for area in areas("IMAGE_EDITOR") if area.ui_type == "IMAGE_EDITOR"), None)
    windows = bpy.context.window_manager.windows
    if area is None and opens_window:
        before = set(windows)
        with bpy.context.temp_override(window=windows[0]):
            bpy.ops.wm.window_new()
        if (new := next((window for window in windows if window not in before), None)) is not None:
            area = max(new.screen.areas, key=lambda area: area.width * area.height)
            area.ui_type = "IMAGE_EDITOR"
    if area is None:
        return
    area.spaces.active.image = image
    area.tag_redraw()
    # View All: an 8K image is larger than the screen.
    window = next(window for window in windows if area in [*window.screen.areas])
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        if bpy.ops.image.view_all.poll():
            bpy.ops.image.view_all(fit_view=True)


def areas(kind: str) -> list[bpy.types.Area]:
    """Areas of type ``kind`` in all windows."""
    return [area for window in bpy.context.window_manager.windows for area in window.screen.areas if area.type == kind]


def redraw(kind: str) -> None:
    """Redraw the areas of type ``kind``, with their sidebars."""
    for area in areas(kind):
        area.tag_redraw()


def redraw_sidebars() -> None:
    """Redraw the sidebars alone: a view of thousands of objects takes long."""
    for region in (region for area in areas("VIEW_3D") for region in area.regions if region.type == "UI"):
        region.tag_redraw()


@bpy.app.handlers.persistent
def _before_save(*_: object) -> None:
    """Keep our images out of the file by removing their users: they lie beside it, or are made again."""
    for image, users in bpy.data.user_map(subset=[image for image in bpy.data.images if OWN in image]).items():
        if all(user.id_type == "SCREEN" for user in users):  # else the artist uses it
            image.user_clear()


def register() -> None:
    """Keep icons for the panel."""
    global _icons
    _icons = bpy.utils.previews.new()


def unregister() -> None:
    """Forget all views, with their icons."""
    global _icons
    forget()
    if _icons is not None:
        bpy.utils.previews.remove(_icons)
        _icons = None


HANDLERS = (("load_post", forget), ("save_pre", _before_save))
