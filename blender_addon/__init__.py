"""Light-field rendering for integral-imaging displays: the part that runs inside Blender.

Blender loads this package as an extension, under a name of Blender's choice, so imports inside it are relative. The
zip has lfsr_core inside it (scripts/build_extension.py); in a clone it lies beside it.
"""

from __future__ import annotations

import importlib

# Each of these may list Blender classes to register in CLASSES, and have a register() and unregister() of its own.
MODULES = ("ui.preferences", "ui.properties", "scene.array.cached", "jobs.preview", "check.last", "jobs.copy",
           "jobs.session", "live.session", "ui.operators.render", "ui.operators.finish", "ui.operators.array",
           "ui.operators.check", "ui.operators.estimate", "ui.operators.plan", "ui.operators.exports",
           "ui.operators.farm", "ui.operators.live", "ui.operators.calibration", "ui.presets", "ui.panels",
           "ui.live_panel", "ui.menus", "ui.overlay", "ui.array_view")


def register() -> None:
    """Register every module's CLASSES with Blender, then call its own ``register``."""
    import bpy

    for module in _modules():
        for cls in getattr(module, "CLASSES", ()):
            bpy.utils.register_class(cls)
        if hasattr(module, "register"):
            module.register()


def unregister() -> None:
    """Undo ``register``, last first."""
    import bpy

    for module in reversed(_modules()):
        if hasattr(module, "unregister"):
            module.unregister()
        for cls in reversed(getattr(module, "CLASSES", ())):
            bpy.utils.unregister_class(cls)


def _modules() -> list:
    return [importlib.import_module(f"{__name__}.{name}") for name in MODULES]
