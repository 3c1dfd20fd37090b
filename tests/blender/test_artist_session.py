"""An artist's session: our buttons and Blender's own in any order, with undo and redo, leave nothing of ours behind."""

import random

import bpy
import pytest

from blender_addon.scene.array import edit, rig
from blender_addon.ui.operators.check import FIXES


def choose(chance):
    """Select some objects, one of them active."""
    objects = list(bpy.context.view_layer.objects)
    for item in objects:
        item.select_set(chance.random() < 0.5)
    bpy.context.view_layer.objects.active = chance.choice(objects) if objects else None


def settings(chance):
    settings = bpy.context.scene.lfsr
    settings.display, settings.scale = chance.choice(["mini", "fhd"]), chance.choice(["2", "4"])
    settings.samples = chance.randint(1, 64)


OPERATORS = {
    "add": lambda chance: bpy.ops.lfsr.array_add(), "fit": lambda chance: bpy.ops.lfsr.array_fit(),
    "remove": lambda chance: bpy.ops.lfsr.array_remove(), "plane": lambda chance: bpy.ops.lfsr.select_plane(),
    "check": lambda chance: bpy.ops.lfsr.check_scene(),
    "fix": lambda chance: bpy.ops.lfsr.check_fix(code=chance.choice(list(FIXES)), target=chance.choice(
        [item.name for item in bpy.data.objects] or [""])),
    "settings": settings, "select": choose,
    "cube": lambda chance: bpy.ops.mesh.primitive_cube_add(location=(chance.random(), chance.random(), 0)),
    "move": lambda chance: bpy.ops.transform.translate(value=(chance.random(), 0, 0)),
    "duplicate": lambda chance: bpy.ops.object.duplicate(), "delete": lambda chance: bpy.ops.object.delete(),
    "key": lambda chance: bpy.context.scene.cycles.keyframe_insert("samples", frame=chance.randint(1, 9)),
    "frame": lambda chance: bpy.context.scene.frame_set(chance.randint(1, 9)), "undo": lambda chance: bpy.ops.ed.undo(),
    "redo": lambda chance: bpy.ops.ed.redo()}


def act(name, chance):
    """One step, as a button does it: what does not apply now is refused, which is no crash."""
    try:
        OPERATORS[name](chance)
    except RuntimeError as error:
        assert "Traceback" not in str(error), f"{name}: {error}"
    if name not in ("undo", "redo"):
        bpy.ops.ed.undo_push(message=name)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(1, 40))])
def test_random_buttons_leave_nothing_of_ours(artist, seed):
    chance, done = random.Random(seed), []
    bpy.ops.ed.undo_push(message="start")
    for _ in range(100):
        done.append(chance.choice(list(OPERATORS)))
        act(done[-1], chance)
        assert not [item.name for item in (*bpy.data.objects, *bpy.data.cameras) if item.name.startswith("LFSR")], done
    assert {"add", "undo", "redo", "remove"} <= set(done)
    scene = bpy.context.scene  # undo made a new one
    act("select", chance)
    act("add", chance)  # planes whose camera was deleted by hand go with the next array
    while rig.find(scene) is not None:
        edit.remove(scene)
    left = [item.name for item in bpy.data.objects if rig.SPACING in item or rig.PLANE in item if item.users_scene]
    assert left == []
