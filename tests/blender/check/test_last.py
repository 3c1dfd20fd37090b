"""The rows of the scene check: findings of one kind are one row, and a change is noticed."""

import bpy
import pytest

from blender_addon.check import last
from blender_addon.check.problem import MOST_ROWS
from blender_addon.scene.array import rig
from blender_addon.ui import panels
from blender_addon.ui.operators import check
from lfsr_core.optics.display import load_display
from tests.blender.ui.test_panels import draw
from tests.support.scenes import add_box, compositing

RODS = 30


@pytest.fixture
def thin(scene) -> list[str]:
    """Names of rods that are thinner than a rendered view shows."""
    placed, _ = rig.placement(scene, load_display("mini"))
    width = 0.1 * 2 * placed.half_width / load_display("mini").lenses[0]
    names = []
    for number in range(RODS):
        rod = add_box(scene, (0.02 * number - 0.3, 0, 0), (width, width, placed.half_height * 0.5))
        rod.name = f"Rod {number:02d}"
        names.append(rod.name)
    bpy.context.view_layer.update()
    return names


def rows() -> dict[str, bpy.types.PropertyGroup]:
    return {row.code: row for row in bpy.context.window_manager.lfsr.problems}


def drawn() -> list[tuple[str, dict]]:
    """The panel with its rows opened."""
    bpy.context.window_manager.lfsr.show_problems = True
    return draw(panels.LFSR_PT_image)


def shown() -> list[str]:
    return [named["text"] for name, named in drawn() if name in ("label", "operator") and "text" in named]


def test_many_objects_are_one_row_that_opens(scene, thin):
    last.check(scene)
    row = rows()["thin"]
    assert (row.title, row.count, row.target) == (f"{RODS} objects are too thin", RODS, "")
    assert row.title in shown() and "Rod 00" not in shown()
    row.expanded = True
    opened = shown()
    assert opened.count("Rod 00") == 1 and f"and {RODS - panels.MOST_NAMES} more" in opened
    last.check(scene)
    assert rows()["thin"].expanded, "it stays open"


def test_the_button_of_a_row_selects_all_or_one(scene, thin):
    last.check(scene)
    assert bpy.ops.lfsr.check_select(code="thin", target="") == {"FINISHED"}
    assert sorted(item.name for item in bpy.context.selected_objects) == thin
    assert bpy.ops.lfsr.check_select(code="thin", target="Rod 03") == {"FINISHED"}
    assert [item.name for item in bpy.context.selected_objects] == ["Rod 03"]


def test_the_button_of_a_row_fixes_all(scene):
    _, far = rig.usable_depth(rig.placement(scene, load_display("mini"))[0], load_display("mini"))
    for name in ("Floor", "Ceiling"):
        add_box(scene, (0, 0, -1), (far * 3, far * 3, 0.01)).name = name
    bpy.context.view_layer.update()
    last.check(scene)
    assert rows()["background"].count == 2
    assert bpy.ops.lfsr.check_fix(code="background", target="") == {"FINISHED"}
    assert "background" not in rows()
    assert sorted(item.name for item in bpy.data.collections["Background"].objects) == ["Ceiling", "Floor"]


def spoil(scene) -> None:
    """Problems of seven kinds."""
    scene.render.use_motion_blur = scene.camera.data.dof.use_dof = True
    scene.camera.data.shift_x, scene.cycles.pixel_filter_type = 0.2, "GAUSSIAN"
    scene.view_layers.new("Second")
    compositing(scene, "CompositorNodeExposure")
    scene.view_layers[0].material_override = bpy.data.materials.new("Clay")


def test_at_most_five_rows_are_shown_at_first_and_each_has_a_button(scene):
    spoil(scene)
    last.check(scene)
    assert len(rows()) == 7 and all(row.fix or row.is_object for row in rows().values())
    boxes = [name for name, _ in drawn() if name == "box"]
    assert len(boxes) == MOST_ROWS and ("prop", "2 More") in [(name, named.get("text")) for name, named in drawn()]
    bpy.context.window_manager.lfsr.all_problems = True
    assert [name for name, _ in drawn()].count("box") == 7
    bpy.context.window_manager.lfsr.all_problems = False


def test_an_artist_is_asked_once_before_a_render(scene):
    assert check.questions(scene) == []
    spoil(scene)
    asked = check.questions(scene)
    assert len(asked) == MOST_ROWS + 1 and asked[-1].sentence == "Scene Check lists 1 more"
    assert any("depth of field" in question.sentence for question in asked)
    assert not any(question.advice for question in asked), "a script goes on without asking"
    asked[0].accept()
    assert check.questions(scene) == []
    scene.view_layers[0].material_override, scene.world = None, None
    bpy.data.objects["Sun"].hide_render = True
    assert check.questions(scene) == [], "one of Blender's world images lights it"
    scene.lfsr.light = "OWN"
    assert [question.sentence.startswith("The scene has no light") for question in check.questions(scene)] == [True]


def test_a_change_is_said_until_the_next_check(scene):
    last.check(scene)
    assert not last.has_changed() and "Check Again" not in shown()
    scene.render.use_motion_blur = True
    bpy.data.objects["Box"].location.x += 0.1
    bpy.context.view_layer.update()
    assert "Check Again" in shown() and "motion" not in rows(), "nothing is done at once"
    last.check(scene)
    assert not last.has_changed() and "motion" in rows()


def test_the_rows_of_another_file_are_forgotten(scene, tmp_path):
    scene.render.use_motion_blur = True
    last.check(scene)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "other.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "other.blend"))
    assert bpy.context.window_manager.lfsr.checked_scene == "" and last.problems() == []
