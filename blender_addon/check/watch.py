"""Keep the scene check up to date: a change marks it stale, and a timer repeats it once Blender is idle.

Nothing here takes time while the artist works: a handler notes when something changed, drawing asks for a check, and a
check that takes long waits for a longer pause.
"""

from __future__ import annotations

import time

import bpy

from ..jobs import denoiser, show_image
from .groups import grouped
from .problem import Problem
from .problems import check_scene

PAUSE = 1.0  # seconds without a change before the scene is checked again
PAUSE_FACTOR = 20.0  # or so many times the seconds of the last check, if that is longer
LOOKS = 0.25  # seconds between looks at whether Blender is idle

_found: list[Problem] = []  # by the last check
_changed = 0.0  # time of the last change since that check, 0 without any
_took = 0.0  # seconds of the last check
_checking = False
_shown = False  # whether the panel was drawn since that check


def found(code: str = "") -> list[Problem]:
    """Return what the last check found, of one kind where ``code`` is given."""
    return [problem for problem in _found if code in ("", problem.code)]


def check(scene: bpy.types.Scene) -> list[Problem]:
    """Check ``scene`` now, fill the panel's rows and return everything found."""
    global _found, _changed, _took, _checking, _shown
    started, _checking = time.monotonic(), True
    try:
        _found = check_scene(scene)
        _fill(scene)
    finally:
        _checking = False
    _changed, _took, _shown = 0.0, time.monotonic() - started, False
    return _found


def wanted(scene: bpy.types.Scene) -> None:
    """Note that the panel shows ``scene``: if it is not checked as it is now, a timer does that."""
    global _shown
    _shown = True
    if _changed or bpy.context.window_manager.lfsr.checked_scene != scene.name_full:
        _start()


def _start() -> None:
    if _shown and not bpy.app.background and not bpy.app.timers.is_registered(_look):
        bpy.app.timers.register(_look, first_interval=LOOKS)


def is_late() -> bool:
    """True if the last check is not of the scene as it is, and the next will wait for a long pause."""
    return bool(_changed) and _pause() > PAUSE


def _pause() -> float:
    return max(PAUSE, PAUSE_FACTOR * _took)


def _look() -> float | None:
    """Timer: check once nothing has changed for a while and no tool, render or playback is at work."""
    scene = bpy.context.scene
    if not denoiser.is_known() or not _is_idle() or time.monotonic() - _changed < _pause():
        return LOOKS
    check(scene)
    redraw()
    return None


def _is_idle() -> bool:
    windows = bpy.context.window_manager.windows
    return not (bpy.app.is_job_running("RENDER") or any(
        window.screen.is_animation_playing or len(window.modal_operators) for window in windows))


def _fill(scene: bpy.types.Scene) -> None:
    state = bpy.context.window_manager.lfsr
    expanded = {row.code for row in state.problems if row.expanded}
    state.checked_scene = scene.name_full
    state.problems.clear()
    for group in grouped(_found):
        row, first = state.problems.add(), group.first
        for name in ("code", "fix", "severity", "is_object"):
            setattr(row, name, getattr(first, name))
        row.title, row.reason, row.count = group.title, group.reason, len(group.problems)
        row.target = first.target if row.count == 1 else ""
        row.expanded = row.count > 1 and row.code in expanded


def redraw() -> None:
    """Redraw the sidebars."""
    for region in (region for area in show_image.areas("VIEW_3D") for region in area.regions):
        if region.type == "UI":
            region.tag_redraw()


@bpy.app.handlers.persistent
def _note(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph | None = None) -> None:
    """Handler of every change: nothing here may take time."""
    if not _checking and (depsgraph is None or len(depsgraph.updates)):
        _mark()


@bpy.app.handlers.persistent
def _opened(*_: object) -> None:
    """Another file: what was found is not of it."""
    global _found, _took
    _found, _took = [], 0.0
    bpy.context.window_manager.lfsr.checked_scene = ""
    _subscribe()  # Blender forgets them with the file


def _mark() -> None:
    global _changed
    _changed = time.monotonic()
    _start()


_OWNER = object()
# Types of settings whose changes Blender does not report as changes of the scene.
SETTINGS = (bpy.types.RenderSettings, bpy.types.ViewLayer, bpy.types.LayerCollection,
            bpy.types.ColorManagedViewSettings)
HANDLERS = (("depsgraph_update_post", _note), ("undo_post", _note), ("redo_post", _note), ("load_post", _opened))


def register() -> None:
    """Listen to changes."""
    for name, handler in HANDLERS:
        getattr(bpy.app.handlers, name).append(handler)
    _subscribe()


def _subscribe() -> None:
    bpy.msgbus.clear_by_owner(_OWNER)
    for kind in SETTINGS:
        bpy.msgbus.subscribe_rna(key=kind, owner=_OWNER, args=(), notify=_mark, options={"PERSISTENT"})


def unregister() -> None:
    """Stop listening."""
    bpy.msgbus.clear_by_owner(_OWNER)
    for name, handler in HANDLERS:
        getattr(bpy.app.handlers, name).remove(handler)
    if bpy.app.timers.is_registered(_look):
        bpy.app.timers.unregister(_look)
