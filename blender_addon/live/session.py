"""The live view that is on: started and stopped by buttons, kept up by a timer, out of the way of saves.

Nothing is remembered but which scene is shown: undo and reloads replace everything else under our hands.
"""

from __future__ import annotations

import bpy

from lfsr_core.errors import LfsrError

from . import scene as live_scene
from . import window as live_window

SECONDS_BETWEEN_LOOKS = 0.1

# ``session_uid`` of the scene that is shown, and the view that was made of it.
_shown: int | None = None
_view: live_scene.View | None = None
_settings: tuple | None = None
_message = ""


def is_on() -> bool:
    """True while a live view is on."""
    return _shown is not None


def message() -> str:
    """What is wrong with the live view, or what to do next; empty where nothing is."""
    return _message


def start(scene: bpy.types.Scene) -> None:
    """Open the live window of ``scene``; LfsrError where it cannot be shown."""
    global _shown
    if is_on():
        raise LfsrError("the live view is on already: press Stop Live first")
    if bpy.context.preferences.addons.get("cycles") is None:
        raise LfsrError("Cycles is switched off in Blender's preferences: switch the Cycles Render Engine add-on on")
    live_scene.view_of(scene, (1, 1))
    live_window.open_window()
    _shown = scene.session_uid
    try:
        keep_up()
    except BaseException:
        stop()
        raise
    bpy.app.timers.register(_look, first_interval=SECONDS_BETWEEN_LOOKS, persistent=True)


def stop() -> None:
    """Close the window and remove everything of ours."""
    global _shown, _view, _settings, _message
    _shown = _view = _settings = None
    _message = ""
    if bpy.app.timers.is_registered(_look):
        bpy.app.timers.unregister(_look)
    live_window.close_window()
    live_scene.remove_all()


def artists_scene() -> bpy.types.Scene | None:
    """The scene that is shown, None if it is gone or nothing is."""
    return next((scene for scene in bpy.data.scenes if scene.session_uid == _shown), None)


def live() -> bpy.types.Scene | None:
    """The live scene, None if there is none."""
    return next((scene for scene in bpy.data.scenes if live_scene.MARK in scene), None)


def keep_up() -> None:
    """Let the live scene show what the artist's scene and the window are now; LfsrError where it cannot."""
    global _view, _settings
    scene, window = artists_scene(), live_window.find()
    region = live_window.region_of(window)
    view, settings = live_scene.view_of(scene, (region.width, region.height)), _settings_of(scene)
    shown = live()
    if shown is None:
        shown = live_scene.make(scene, view)
    elif (view, settings) != (_view, _settings) or shown.background_set != scene:
        shown.background_set = scene
        live_scene.show(shown, view)
    else:
        live_scene.follow(shown)
        if window.scene == shown:
            return
    _view, _settings = view, settings
    live_window.show(window, shown)


def _settings_of(scene: bpy.types.Scene) -> tuple:
    """Settings that need the live scene's nodes again."""
    return (scene.lfsr.live_smooth,)


def _look() -> float | None:
    """Timer: keep up, or stop where the window or the scene is gone."""
    global _message
    if not is_on():
        return None
    window = live_window.find()
    if window is None or artists_scene() is None:
        stop()
        return None
    try:
        keep_up()
        _say(_view.region.sentence() or "")
    except LfsrError as error:
        _say(str(error))
    return SECONDS_BETWEEN_LOOKS


def _say(text: str) -> None:
    global _message
    if text != _message:
        _message = text
        for window in bpy.context.window_manager.windows:
            for area in window.screen.areas:
                if area.type == "VIEW_3D":
                    area.tag_redraw()


@bpy.app.handlers.persistent
def _before_save(*_: object) -> None:
    """Nothing of ours goes into the file."""
    window, scene = live_window.find(), artists_scene()
    if window is not None and scene is not None:
        live_window.hide(window, scene)
    live_scene.remove_all()


@bpy.app.handlers.persistent
def _after_save(*_: object) -> None:
    """The live view goes on; the timer would do it too, a moment later."""
    if is_on() and live_window.find() is not None:
        _look()


@bpy.app.handlers.persistent
def _before_load(*_: object) -> None:
    stop()


@bpy.app.handlers.persistent
def _tidy(*_: object) -> None:
    """After an undo or in a file from a crash there may be something of a live view that is off."""
    if not is_on():
        live_window.close_window()
        live_scene.remove_all()


@bpy.app.handlers.persistent
def _frame_changed(scene: bpy.types.Scene, *_: object) -> None:
    shown = live()
    if shown is not None and scene.session_uid == _shown and shown.frame_current != scene.frame_current:
        shown.frame_set(scene.frame_current, subframe=scene.frame_subframe)


HANDLERS = {"save_pre": _before_save, "save_post": _after_save, "save_post_fail": _after_save, "load_pre": _before_load,
            "load_post": _tidy, "undo_post": _tidy, "redo_post": _tidy, "frame_change_post": _frame_changed}


def register() -> None:
    """Listen to what a live view must give way to."""
    for name, handler in HANDLERS.items():
        getattr(bpy.app.handlers, name).append(handler)


def unregister() -> None:
    """Stop what is on."""
    stop()
    for name, handler in HANDLERS.items():
        getattr(bpy.app.handlers, name).remove(handler)
