"""Show images in an Image Editor that is open; none is opened over the artist's work unasked."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

OWN = "lfsr_image"  # property of images that we have loaded: the file need not keep them


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
    window = next((window for window in windows if area in list(window.screen.areas)), None)
    region = next((region for region in area.regions if region.type == "WINDOW"), None)
    if window is not None and region is not None:
        with bpy.context.temp_override(window=window, area=area, region=region):
            if bpy.ops.image.view_all.poll():
                bpy.ops.image.view_all(fit_view=True)


def areas(kind: str) -> list[bpy.types.Area]:
    """Areas of type ``kind`` in all windows."""
    return [area for window in bpy.context.window_manager.windows for area in window.screen.areas if area.type == kind]


def redraw_views() -> None:
    """Redraw the 3D views, with their sidebars."""
    for area in areas("VIEW_3D"):
        area.tag_redraw()


def redraw_sidebars() -> None:
    """Redraw the sidebars alone: a view of thousands of objects takes long."""
    for region in (region for area in areas("VIEW_3D") for region in area.regions if region.type == "UI"):
        region.tag_redraw()


def top_window() -> bpy.types.Window | None:
    """Return the window that no other window of this Blender hides: of those that lie over others, the newest."""
    windows = bpy.context.window_manager.windows
    return next((window for window in reversed(windows) if window.parent is not None), next(iter(windows), None))


@contextmanager
def wait_cursor() -> Iterator[None]:
    """Show in every window that Blender is busy inside the block; background mode has none."""
    windows = [] if bpy.app.background else list(bpy.context.window_manager.windows)
    for window in windows:
        window.cursor_modal_set("WAIT")
    try:
        yield
    finally:
        for window in windows:
            window.cursor_modal_restore()
