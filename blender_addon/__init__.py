"""Light-field rendering for integral-imaging displays: the part that runs inside Blender."""

from __future__ import annotations

import importlib
import importlib.util

# Each of these may list Blender classes to register in CLASSES.
MODULES = ("properties", "operators", "panels")


def _modules() -> list:
    present = [name for name in MODULES if importlib.util.find_spec(f"{__name__}.{name}")]
    return [importlib.import_module(f"{__name__}.{name}") for name in present]


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
