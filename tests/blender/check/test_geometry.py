"""Objects that the display cannot show well are found and named."""

import bpy
import numpy as np
import pytest

from blender_addon.scene.array import rig
from lfsr_core.optics.display import load_display
from tests.support.problems import fix, found
from tests.support.scenes import add_box

MINI = load_display("mini")


def at_depth(scene, depth: float, half: float, lift: float = 0.0) -> bpy.types.Object:
    """Box centred on the view at ``depth``, ``lift`` half-heights above."""
    placed, matrix = rig.placement(scene, MINI)
    place = np.array(matrix) @ (0, lift * placed.half_height * depth / placed.distance, depth, 1)
    return add_box(scene, tuple(place[:3]), (half, half, half))


@pytest.mark.parametrize("side", ["near", "far"])
def test_outside_the_usable_depth(scene, side):
    placed, _ = rig.placement(scene, MINI)
    near, far = rig.usable_depth(placed, MINI)
    item = at_depth(scene, near * 0.8 if side == "near" else far * 1.3, placed.half_width * 0.15)
    item.name = "Stray"
    bpy.context.view_layer.update()
    problem = found(scene, "depth")
    assert problem.target == "Stray" and problem.is_object and " m" in problem.reason
    assert bpy.ops.lfsr.check_select(target="Stray") == {"FINISHED"}
    assert [o.name for o in bpy.context.selected_objects] == ["Stray"]


def test_objects_out_of_sight_are_no_problem(scene):
    placed, _ = rig.placement(scene, MINI)
    at_depth(scene, -placed.distance, 0.1)
    at_depth(scene, placed.distance * 50, 0.1, lift=4)
    bpy.context.view_layer.update()
    assert found(scene, "depth") is None


def test_thinner_than_the_sparse_views_can_see(scene):
    placed, _ = rig.placement(scene, MINI)
    pitch = 2 * placed.half_width / MINI.lenses[0]
    rod = add_box(scene, (0, 0, 0), (pitch * 0.1, pitch * 0.1, placed.half_height * 0.5))
    rod.name = "Rod"
    bpy.context.view_layer.update()
    assert found(scene, "thin").target == "Rod"
    rod.scale = (15, 15, 1)
    bpy.context.view_layer.update()
    assert found(scene, "thin") is None


@pytest.mark.parametrize("kind", ["wall", "floor"])
def test_background_not_marked(scene, kind):
    placed, _ = rig.placement(scene, MINI)
    _, far = rig.usable_depth(placed, MINI)
    if kind == "wall":
        at_depth(scene, far * 1.5, far * 2).name = "Set"
    else:
        add_box(scene, (0, 0, -1), (far * 3, far * 3, 0.01)).name = "Set"
    bpy.context.view_layer.update()
    assert found(scene, "background").target == "Set"
    fix(scene, "background")
    assert [c.name for c in bpy.data.objects["Set"].users_collection] == ["Background"]
