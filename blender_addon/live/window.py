"""The live windows: main windows, which can show another scene, with nothing but a 3D view."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import bpy

from lfsr_core.base.errors import LfsrError

from .scene import MARK, PANEL

SECONDS_TO_ACT = 0.05
LEFT = "left"  # value of MARK: the screen of a live window that is closed
_removals: list[Iterator[float]] = []


def find(kind: str = PANEL) -> bpy.types.Window | None:
    """Return the live window of one kind, None if it is closed."""
    return next((window for window in bpy.context.window_manager.windows if window.screen.get(MARK) == kind), None)


def open_window(kind: str = PANEL) -> bpy.types.Window:
    """Open a window that is one 3D view from edge to edge; LfsrError if Blender cannot."""
    before = set(bpy.context.window_manager.windows)
    if bpy.app.background or not before:
        raise LfsrError("Blender runs without a window, but the live view needs one: start Blender with its window")
    if bpy.ops.wm.window_new_main() != {"FINISHED"}:
        raise LfsrError("Blender opened no second window: close another window and try again")
    window = next(window for window in bpy.context.window_manager.windows if window not in before)
    while len(window.screen.areas) > 1:
        # All areas but the largest are closed; some close only after a neighbour has.
        closed = False
        for area in sorted(window.screen.areas, key=lambda area: area.width * area.height)[:-1]:
            with (bpy.context.temp_override(window=window, screen=window.screen, area=area),
                  contextlib.suppress(RuntimeError)):
                closed = bpy.ops.screen.area_close() == {"FINISHED"}
            if closed:
                break
        if not closed:
            raise LfsrError("Blender's new window cannot become a single view: use the workspace Layout and try again")
    window.screen[MARK] = kind
    area = window.screen.areas[0]
    area.type = "VIEW_3D"
    with _place(window):
        bpy.ops.screen.screen_full_area(use_hide_panels=True)
    window.screen[MARK] = kind
    return window


def toggle_full_screen(window: bpy.types.Window) -> None:
    """Make a window full screen on the screen where it is, or a window again."""
    with bpy.context.temp_override(window=window):
        bpy.ops.wm.window_fullscreen_toggle()


def close_window(kind: str = PANEL) -> None:
    """Close the live window of one kind, if it is open, and remove its screens, which Blender would keep."""
    window = find(kind)
    if window is not None:
        if window.screen.show_fullscreen:
            with bpy.context.temp_override(window=window, area=window.screen.areas[0]):
                bpy.ops.screen.back_to_previous()
        with bpy.context.temp_override(window=window):
            bpy.ops.wm.window_close()
    for screen in bpy.data.screens:
        if screen.get(MARK) == kind:
            screen[MARK] = LEFT
    if any(screen.get(MARK) == LEFT for screen in bpy.data.screens):
        if not bpy.app.timers.is_registered(_remove):  # also after another file was opened, which ends it
            _removals.clear()
            bpy.app.timers.register(_remove, first_interval=0)
        _removals.append(_removal())


def _remove() -> float | None:
    """Timer: one removal after the other."""
    while _removals:
        if (seconds := next(_removals[0], None)) is not None:
            return seconds
        del _removals[0]
    return None


def _removal() -> Iterator[float]:
    """Remove screens that are left, and yield where Blender must act first.

    Blender deletes only the screen that a window shows. So a main window shows each for a moment, which Blender acts on
    after the timers, mostly before it draws. A screen of a workspace that no window shows stays until the next time.
    """
    homes: dict[str, str] = {}  # by workspace: what its window shows
    for name in [screen.name for screen in bpy.data.screens if screen.get(MARK) == LEFT]:
        screen = bpy.data.screens.get(name)
        window = next((window for window in bpy.context.window_manager.windows
                       if window.parent is None and name in window.workspace.screens), None)
        if screen is None or window is None:
            continue
        home = homes.setdefault(window.workspace.name, window.screen.name)
        window.screen = screen
        if screen.show_fullscreen:  # of a window that the user has closed: Blender shows the one without borders
            while window.screen.name == home:
                yield SECONDS_TO_ACT
            with bpy.context.temp_override(window=window, screen=window.screen, area=window.screen.areas[0]):
                bpy.ops.screen.back_to_previous()
            screen = window.screen
        with bpy.context.temp_override(window=window, screen=screen):
            bpy.ops.screen.delete()
        window.screen = bpy.data.screens[home]
        while window.screen.name != home:
            yield SECONDS_TO_ACT


def region_of(window: bpy.types.Window) -> bpy.types.Region:
    """Return the region in which the 3D view is drawn."""
    return next(region for region in window.screen.areas[0].regions if region.type == "WINDOW")


def show(window: bpy.types.Window, live: bpy.types.Scene) -> None:
    """Show ``live`` rendered by Cycles through its camera, pixel by pixel, without overlays."""
    window.scene = live
    space = window.screen.areas[0].spaces.active
    space.overlay.show_overlays = space.show_gizmo = False
    space.shading.type = "RENDERED"
    space.shading.use_compositor = "ALWAYS"
    space.use_local_camera = False
    view = space.region_3d
    view.view_perspective, view.view_camera_offset = "CAMERA", (0.0, 0.0)
    with _place(window):
        bpy.ops.view3d.zoom_camera_1_to_1()


def _place(window: bpy.types.Window) -> bpy.types.ContextTempOverride:
    return bpy.context.temp_override(window=window, area=window.screen.areas[0], region=region_of(window))
