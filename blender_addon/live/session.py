"""Start, update and stop the live views, and keep them out of saved files."""

from __future__ import annotations

import dataclasses

import bpy

from lfsr_core.base.errors import LfsrError

from ..scene import devices
from . import scene as live_scene
from . import window as live_window
from .scene import EYE, PANEL

SECONDS_BETWEEN_UPDATES = 0.1
# A region large enough for any display, to check a view before there is a window.
LARGE = (65536, 65536)


@dataclasses.dataclass
class _Shown:
    """One live view that is on."""

    scene: int  # ``session_uid`` of the artist's scene
    view: live_scene.View | None = None  # view and smoothing that the live scene was made with
    smooth: bool | None = None
    message: str = ""  # what is wrong or what to do next


# Only the identity of the scene is stored: undo and reloads replace everything else.
_on: dict[str, _Shown] = {}


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
    devices.cycles_preferences()
    live_scene.view_of(scene, LARGE, kind)
    live_window.open_window(kind)
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
        live_window.close_window(kind)
        live_scene.remove_all(kind)
    if not _on and bpy.app.timers.is_registered(_update):
        bpy.app.timers.unregister(_update)


def artists_scene(kind: str = PANEL) -> bpy.types.Scene | None:
    """Return the scene that is shown, None if it is gone or none is."""
    return next((scene for scene in bpy.data.scenes if kind in _on and scene.session_uid == _on[kind].scene), None)


def live(kind: str = PANEL) -> bpy.types.Scene | None:
    """Return the live scene, None if there is none."""
    return next((scene for scene in bpy.data.scenes if scene.get(live_scene.MARK) == kind), None)


def keep_up(kind: str = PANEL) -> None:
    """Update the live scene to the artist's scene and the window; LfsrError if it cannot be shown."""
    scene, window, state = artists_scene(kind), live_window.find(kind), _on[kind]
    if scene is None or window is None:
        return
    region = live_window.region_of(window)
    view, smooth = live_scene.view_of(scene, (region.width, region.height), kind), scene.lfsr.live_smooth
    shown = live(kind)
    if shown is None:
        shown = live_scene.make(scene, view)
    elif (view, smooth) != (state.view, state.smooth) or shown.background_set != scene:
        shown.background_set = scene
        live_scene.show(shown, view)
    else:
        live_scene.follow(shown)
        if window.scene == shown:
            return
    state.view, state.smooth = view, smooth
    live_window.show(window, shown)


def _update() -> float | None:
    """Timer: update the live views, and stop those whose window or scene is gone."""
    for kind in tuple(_on):
        if live_window.find(kind) is None or artists_scene(kind) is None:
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
        for window in bpy.context.window_manager.windows:
            for area in window.screen.areas:
                if area.type == "VIEW_3D":
                    area.tag_redraw()


@bpy.app.handlers.persistent
def _before_save(*_: object) -> None:
    """Keep the live scenes out of the file."""
    for kind in _on:
        window, scene = live_window.find(kind), artists_scene(kind)
        if window is not None and scene is not None:  # solid while there is no live scene
            window.screen.areas[0].spaces.active.shading.type = "SOLID"
            window.scene = scene
    live_scene.remove_all()


@bpy.app.handlers.persistent
def _after_save(*_: object) -> None:
    """Show the live views again, without waiting for the timer."""
    if any(live_window.find(kind) is not None for kind in _on):
        _update()


@bpy.app.handlers.persistent
def _before_load(*_: object) -> None:
    stop()


@bpy.app.handlers.persistent
def _tidy(*_: object) -> None:
    """Remove what an undo, or a file from a crash, has brought back of live views that are off."""
    off = {PANEL, EYE} - set(_on)
    if off:
        stop(*off)


@bpy.app.handlers.persistent
def _frame_changed(scene: bpy.types.Scene, *_: object) -> None:
    for kind, state in _on.items():
        shown = live(kind)
        if shown is not None and scene.session_uid == state.scene and shown.frame_current != scene.frame_current:
            shown.frame_set(scene.frame_current, subframe=scene.frame_subframe)


HANDLERS = (("save_pre", _before_save), ("save_post", _after_save), ("save_post_fail", _after_save),
            ("load_pre", _before_load), ("load_post", _tidy), ("undo_post", _tidy), ("redo_post", _tidy),
            ("frame_change_post", _frame_changed))
unregister = stop
