"""Light-field rendering for integral-imaging displays: the part that runs inside Blender.

Blender loads this package as an extension, under a name of Blender's choice, so imports inside it are relative. The
zip has lfsr_core inside it (scripts/build_extension.py); in a clone it lies beside it.
"""

import importlib

# Each of these may list in CLASSES what Blender registers, in HANDLERS what it calls after changes (name, function), in
# DRAWN what draws in every 3D view (event, function), and have a register() and unregister() of its own.
MODULES = ("ui.properties", "scene.array.rig", "jobs.images", "jobs.folders", "check.last", "jobs.runtime",
           "jobs.session", "live.session", "ui.operators.render", "ui.operators.array", "ui.operators.check",
           "ui.operators.plan", "ui.operators.show", "ui.panels", "ui.array_view")


_drawn: list[object] = []


def register() -> None:
    """Register every module's CLASSES with Blender, call its own ``register`` and add its handlers."""
    import bpy

    for module in _modules():
        for cls in getattr(module, "CLASSES", ()):
            bpy.utils.register_class(cls)
        if hasattr(module, "register"):
            module.register()
        for name, handler in getattr(module, "HANDLERS", ()):
            getattr(bpy.app.handlers, name).append(handler)
        if not bpy.app.background:  # which has no 3D views
            _drawn.extend(bpy.types.SpaceView3D.draw_handler_add(draw, (), "WINDOW", event)
                          for event, draw in getattr(module, "DRAWN", ()))


def unregister() -> None:
    """Undo ``register``, last first."""
    import bpy

    while _drawn:
        bpy.types.SpaceView3D.draw_handler_remove(_drawn.pop(), "WINDOW")
    for module in reversed(_modules()):
        for name, handler in getattr(module, "HANDLERS", ()):
            getattr(bpy.app.handlers, name).remove(handler)
        if hasattr(module, "unregister"):
            module.unregister()
        for cls in reversed(getattr(module, "CLASSES", ())):
            bpy.utils.unregister_class(cls)


def _modules() -> list:
    return [importlib.import_module(f"{__name__}.{name}") for name in MODULES]
