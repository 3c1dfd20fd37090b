"""Check a scene: what the last check found, and whether the scene has changed since."""

import bpy

from ..jobs import images
from . import geometry, look
from .problems import QUICK, SEVERITIES, Problem, denoiser, grouped

rows: list[Problem] = []  # the panel's, of the last check
changed = False  # whether something has changed since
_problems: list[Problem] = []
_checking = False
_OWNER = object()
LATE = 0.2  # seconds within which Blender tells of a change
# Types of settings whose changes Blender does not report as changes of the scene.
SETTINGS = (bpy.types.RenderSettings, bpy.types.ViewLayer, bpy.types.LayerCollection,
            bpy.types.ColorManagedViewSettings)


def check_scene(scene: bpy.types.Scene) -> list[Problem]:
    """Return everything found, worst first."""
    problems = (problem for check in (*QUICK, look.find, denoiser, geometry.find) for problem in check(scene))
    return sorted(problems, key=lambda problem: SEVERITIES.index(problem.severity))


def problems(code: str = "") -> list[Problem]:
    """Return what the last check found, of one kind where ``code`` is given."""
    return [problem for problem in _problems if code in ("", problem.code)]


def check(scene: bpy.types.Scene) -> list[Problem]:
    """Check ``scene`` now and return everything found."""
    global rows, changed, _problems, _checking
    _checking = True  # what it writes is no change of the scene
    try:
        _problems = check_scene(scene)
        rows = grouped(_problems)
        bpy.context.window_manager.lfsr.checked_scene = scene.name_full
    finally:
        if bpy.app.background:
            _end()
        else:  # Blender tells of what was written when its loop goes on, and after it has drawn
            bpy.app.timers.register(_end, first_interval=LATE, persistent=True)
    changed = False
    images.redraw_sidebars()
    return _problems


def _end() -> None:
    global _checking
    _checking = False


def _mark() -> None:
    global changed
    if not changed and not _checking:
        changed = True
        images.redraw_sidebars()


@bpy.app.handlers.persistent
def _note(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph | None = None) -> None:
    """Handler of every change: nothing here may take time."""
    if depsgraph is None or len(depsgraph.updates):
        _mark()


@bpy.app.handlers.persistent
def _opened(*_: object) -> None:
    """Another file is open: note what came with it, and forget what was found in the last one."""
    look.newest = max((item.session_uid for item in bpy.data.objects), default=0)
    _problems.clear()
    rows.clear()
    bpy.context.window_manager.lfsr.checked_scene = ""
    register()  # Blender drops subscriptions with the file


def register() -> None:
    """Listen to changes, anew."""
    bpy.msgbus.clear_by_owner(_OWNER)
    for kind in SETTINGS:
        bpy.msgbus.subscribe_rna(key=kind, owner=_OWNER, args=(), notify=_mark, options={"PERSISTENT"})


def unregister() -> None:
    """Stop listening."""
    bpy.msgbus.clear_by_owner(_OWNER)


HANDLERS = (("depsgraph_update_post", _note), ("undo_post", _note), ("redo_post", _note), ("load_post", _opened))
