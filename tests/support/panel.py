"""What the tests of the panel share: the registered add-on, a small saved scene, and a picture of its settings."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bpy
import pytest

import blender_addon
from blender_addon.check.last import check_scene
from blender_addon.check.problems import Problem
from blender_addon.jobs import images, session
from blender_addon.scene import settings as scene_settings
from blender_addon.scene.array import edit
from tests.support import processes
from tests.support.scenes import add_box

SECONDS_TO_RENDER = 300


@contextmanager
def registered() -> Iterator[None]:
    """The add-on's classes are registered inside the block."""
    blender_addon.register()
    try:
        yield
    finally:
        session.cancel()
        images.forget()
        blender_addon.unregister()


def artist_scene(folder: Path | None) -> bpy.types.Scene:
    """A lit box in front of a mini display, rendered with the fewest rays; saved in ``folder`` if there is one."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    add_box(scene, (0.0, 0.0, 0.0), (0.5, 0.3, 0.4)).name = "Box"
    light = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    light.data.energy, light.rotation_euler = 3.0, (0.9, 0.0, 0.3)
    scene.collection.objects.link(light)
    scene.render.engine = "CYCLES"
    scene.lfsr.display, scene.lfsr.scale, scene.lfsr.samples, scene.lfsr.method = "mini", "2", 1, "bicubic"
    edit.fit(scene, scene_settings.display_of(scene), [bpy.data.objects["Box"]])
    if folder is not None:
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
    return scene


def frame_one(file: Path) -> Path:
    """Frame folder of frame 1 of the saved ``artist_scene``."""
    return file.parent / "lightfield" / file.stem / "Scene" / "0001"


def refused(pattern: str, operator: Callable[..., Any], **options: Any) -> None:
    """Press a button that reports an error: one line in which ``pattern`` is found."""
    with pytest.raises(RuntimeError, match=pattern) as caught:
        operator(**options)
    assert str(caught.value).strip().count("\n") == 0


def wait_for(condition: Callable[[], bool], look: bool = True) -> None:
    """Turn the task's timer by hand until ``condition``: without a window nothing else does."""
    processes.wait_for(lambda: (look and session._look(), condition())[1], SECONDS_TO_RENDER)


def problem_of(scene, code: str) -> Problem | None:
    """The first problem of ``code``, or None."""
    return next((problem for problem in check_scene(scene) if problem.code == code), None)


def fix(scene, code: str) -> None:
    """Press the button of ``code``; the problem is gone afterwards."""
    problem = problem_of(scene, code)
    assert problem is not None and problem.fix
    assert bpy.ops.lfsr.check_fix(code=code, target=problem.target) == {"FINISHED"} and problem_of(scene, code) is None
