"""The scene check as an artist uses it: find a problem by its code, press its button."""

import bpy

from blender_addon.check import problems


def found(scene, code: str) -> problems.Problem | None:
    """The first problem of ``code``, or None."""
    return next((problem for problem in problems.check_scene(scene) if problem.code == code), None)


def fix(scene, code: str) -> None:
    """Press the button of ``code``; the problem is gone afterwards."""
    problem = found(scene, code)
    assert problem is not None and problem.fix
    assert bpy.ops.lfsr.check_fix(code=code, target=problem.target) == {"FINISHED"}
    assert found(scene, code) is None
