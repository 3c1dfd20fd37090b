"""Start, update and stop the live views and their windows, and keep them out of saved files.

The windows show another scene than Blender's own, with nothing but a 3D view: the panel's is a main window, which can
be exact on a display, the eye's a smaller one beside the sidebar.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterator

import bpy

from lfsr_core.base.messages import LfsrError

from .. import compat
from ..scene.settings import display_of
from . import scene as live_scene
from .scene import EYE, MARK, PANEL

SECONDS_BETWEEN_UPDATES = 0.1
# A region large enough for any display, to check a view before there is a window.
LARGE = (65536, 65536)
SECONDS_TO_ACT = 0.05
SHARE, MOST_ROOM = 2 / 3, 0.9  # of the display; of the room beside the sidebar
NO_WINDOW = "Blender runs without a window, but the live view needs one: start Blender with its window"
NO_SECOND = "Blender opened no second window: leave a maximized area or close another window, and try again"
LEFT = "left"  # value of MARK: the screen of a live window that is closed


@dataclasses.dataclass
class _Shown:
    """One live view that is on."""

    scene: int  # ``session_uid`` of the artist's scene
    view: live_scene.View | None = None  # that the live scene was made with
    zoom: float = 0.0  # at which a pixel of the view is one of the window
    message: str = ""  # what is wrong or what to do next


# Only the identity of the scene is stored: undo and reloads replace everything else.
_on: dict[str, _Shown] = {}
_removals: list[Iterator[float]] = []


def is_on(kind: str = PANEL) -> bool:
    """Return True while a live view of this kind is on."""
    return kind in _on


def message(kind: str = PANEL) -> str:
    """Return what is wrong with the live view or what to do next, "" if nothing is."""
    return _on[kind].message if kind in _on else ""


def start(scene: bpy.types.Scene, kind: str = PANEL) -> None:
    """Open the live window of ``scene``; LfsrError if it cannot be shown."""
    if is_on(kind):
        raise LfsrError("the live view is on already: press Stop Live first")
    compat.cycles_preferences()
    live_scene.view_of(scene, LARGE, kind)
    _beside(scene) if kind == EYE else open_window()
    _on[kind] = _Shown(scene.session_uid)
    try:
        keep_up(kind)
    except BaseException:
        stop(kind)
        raise
    if not bpy.app.timers.is_registered(_update):
        bpy.app.timers.register(_update, first_interval=SECONDS_BETWEEN_UPDATES, persistent=True)


def stop(*kinds: str) -> None:
    """Close the windows of these kinds, by default of all, and remove their live scenes."""
    for kind in kinds or (PANEL, EYE):
        _on.pop(kind, None)
        close_window(kind)
        live_scene.remove_all(kind)
    if not _on and bpy.app.timers.is_registered(_update):
        bpy.app.timers.unregister(_update)


@bpy.app.handlers.persistent
def _stop(*_: object) -> None:
    stop()


def artists_scene(kind: str = PANEL) -> bpy.types.Scene | None:
    """Return the scene that is shown, None if it is gone or none is."""
    return next((scene for scene in bpy.data.scenes if kind in _on and scene.session_uid == _on[kind].scene), None)


def live(kind: str = PANEL) -> bpy.types.Scene | None:
    """Return the live scene, None if there is none."""
    return next((scene for scene in bpy.data.scenes if scene.get(MARK) == kind), None)


def keep_up(kind: str = PANEL) -> None:
    """Update the live scene to the artist's scene and the window; LfsrError if it cannot be shown."""
    scene, window, state = artists_scene(kind), find_window(kind), _on[kind]
    if scene is None or window is None:
        return
    space, region = space_of(window), region_of(window)
    view = live_scene.view_of(scene, (region.width, region.height), kind)
    if (shown := live(kind)) is None:
        shown = live_scene.make(scene, view)
    elif view != state.view or shown.background_set != scene or shown.camera is None:
        shown.background_set = scene
        live_scene.show(shown, view)
    else:
        live_scene.follow(shown)
        place = space.region_3d
        if window.scene == shown and (place.view_perspective, place.view_camera_zoom) == ("CAMERA", state.zoom):
            return
    state.view = view
    # Rendered by Cycles in the scene's light through its camera, pixel by pixel, without overlays.
    window.scene = shown
    space.overlay.show_overlays = space.show_gizmo = space.use_local_camera = False
    space.shading.type, space.shading.use_compositor = "RENDERED", "ALWAYS"
    space.shading.cycles.render_pass = "COMBINED"
    space.shading.use_scene_lights_render = space.shading.use_scene_world_render = True
    space.region_3d.view_perspective, space.region_3d.view_camera_offset = "CAMERA", (0.0, 0.0)
    with _place(window):
        bpy.ops.view3d.zoom_camera_1_to_1()
    state.zoom = space.region_3d.view_camera_zoom


def _update() -> float | None:
    """Timer: update the live views, and stop those whose window or scene is gone."""
    for kind in tuple(_on):
        if find_window(kind) is None or artists_scene(kind) is None:
            stop(kind)
            continue
        try:
            keep_up(kind)
            view = _on[kind].view
            _say(kind, (view.region.sentence() if view and kind == PANEL else None) or "")
        except LfsrError as error:
            _say(kind, str(error))
    return SECONDS_BETWEEN_UPDATES if _on else None


def _say(kind: str, text: str) -> None:
    if text != _on[kind].message:
        _on[kind].message = text
        windows = bpy.context.window_manager.windows
        for area in (area for window in windows for area in window.screen.areas if area.type == "VIEW_3D"):
            area.tag_redraw()


def find_window(kind: str = PANEL) -> bpy.types.Window | None:
    """Return the live window of one kind, None if it is closed."""
    return next((window for window in bpy.context.window_manager.windows if window.screen.get(MARK) == kind), None)


def _beside(scene: bpy.types.Scene) -> None:
    """Open the eye's window beside the sidebar: two thirds of the display, or what there is room for.

    It is Blender's window of a rendered image, the only one that has a given size and can show another scene.
    """
    context, before = bpy.context, list(bpy.context.window_manager.windows)
    if bpy.app.background or not before:
        raise LfsrError(NO_WINDOW)
    room = (min([context.window.width, *(region.x for area in context.screen.areas if area.type == "VIEW_3D"
                                         for region in area.regions if region.type == "UI" and region.width > 1)]),
            context.window.height)
    pixels, sizes = display_of(scene).panel_pixels, bpy.data.scenes.new("LFSR Window")
    share = min(SHARE, *(MOST_ROOM * there / wanted for there, wanted in zip(room, pixels, strict=True)))
    # Blender adds its borders, which this window does not have.
    sizes.render.resolution_x, sizes.render.resolution_y = (
        max(4, round(share * side - border * context.preferences.system.ui_scale))
        for side, border in zip(pixels, (30, 60), strict=True))
    sizes.render.resolution_percentage = 100
    # Blender would show a rendered image's window again.
    images = [window.screen.areas[0] for window in before
              if window.screen.is_temporary and window.screen.areas[0].type == "IMAGE_EDITOR"]
    usual = context.preferences.view.render_display_type
    try:
        context.preferences.view.render_display_type = "WINDOW"
        for area in images:
            area.type = "VIEW_3D"
        with context.temp_override(scene=sizes):
            bpy.ops.render.view_show("INVOKE_DEFAULT")
    finally:
        context.preferences.view.render_display_type = usual
        for area in images:
            area.type = "IMAGE_EDITOR"
        window = next((window for window in context.window_manager.windows if window not in before), None)
        if window is not None:
            window.scene = scene
        bpy.data.scenes.remove(sizes)
    if window is None:
        raise LfsrError(NO_SECOND)
    window.screen[MARK] = EYE
    window.screen.areas[0].type = "VIEW_3D"
    space = window.screen.areas[0].spaces.active
    space.show_region_header = space.show_region_toolbar = space.show_region_ui = False  # the tool header goes too


def open_window() -> None:
    """Open a window that is one 3D view from edge to edge; LfsrError if Blender cannot."""
    before = set(bpy.context.window_manager.windows)
    if bpy.app.background or not before:
        raise LfsrError(NO_WINDOW)
    if not bpy.ops.wm.window_new_main.poll() or bpy.ops.wm.window_new_main() != {"FINISHED"}:
        raise LfsrError(NO_SECOND)
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
    window.screen[MARK] = PANEL
    area = window.screen.areas[0]
    area.type = "VIEW_3D"
    with _place(window):
        bpy.ops.screen.screen_full_area(use_hide_panels=True)
    window.screen[MARK] = PANEL


def close_window(kind: str = PANEL) -> None:
    """Close the live window of one kind, if it is open, and remove its screens, which Blender would keep."""
    if (window := find_window(kind)) is not None:
        if window.screen.show_fullscreen:
            with bpy.context.temp_override(window=window, area=window.screen.areas[0]):
                bpy.ops.screen.back_to_previous()
        if all(other.parent or other == window for other in bpy.context.window_manager.windows):
            bpy.ops.wm.window_new_main()  # Blender ends with its last main window
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


def space_of(window: bpy.types.Window) -> bpy.types.SpaceView3D:
    """Return the 3D view of a live window, instead of another editor that was chosen there."""
    if (area := window.screen.areas[0]).type != "VIEW_3D":
        area.type = "VIEW_3D"
    return area.spaces.active


def region_of(window: bpy.types.Window) -> bpy.types.Region:
    """Return the region in which the 3D view is drawn."""
    return next(region for region in window.screen.areas[0].regions if region.type == "WINDOW")


def _place(window: bpy.types.Window) -> bpy.types.ContextTempOverride:
    return bpy.context.temp_override(window=window, area=window.screen.areas[0], region=region_of(window))


@bpy.app.handlers.persistent
def _before_save(*_: object) -> None:
    """Keep the live scenes out of the file."""
    for kind in _on:
        if (window := find_window(kind)) is not None:  # solid while there is no live scene
            space_of(window).shading.type = "SOLID"
    live_scene.remove_all()


@bpy.app.handlers.persistent
def _after_save(*_: object) -> None:
    """Show the live views again, without waiting for the timer."""
    if any(find_window(kind) is not None for kind in _on):
        _update()


@bpy.app.handlers.persistent
def _tidy(*_: object) -> None:
    """Remove live scenes that an undo or a recovered file has brought back although their view is off."""
    if off := {PANEL, EYE} - set(_on):
        stop(*off)


@bpy.app.handlers.persistent
def _frame_changed(scene: bpy.types.Scene, *_: object) -> None:
    for kind, state in _on.items():
        shown = live(kind)
        if shown is not None and scene.session_uid == state.scene and shown.frame_current != scene.frame_current:
            shown.frame_set(scene.frame_current, subframe=scene.frame_subframe)


HANDLERS = (("save_pre", _before_save), ("save_post", _after_save), ("save_post_fail", _after_save),
            ("load_pre", _stop), ("load_post", _tidy), ("undo_post", _tidy), ("redo_post", _tidy),
            ("frame_change_post", _frame_changed))
unregister = stop
