"""The scene check: each cause is found and named, and its button removes it."""

import shutil
from pathlib import Path

import bpy
import numpy as np
import pytest

from blender_addon.check import last, problems
from blender_addon.check.problems import MOST_ROWS, Problem
from blender_addon.compat import use_nodes
from blender_addon.scene import settings as scene_settings
from blender_addon.scene.array import rig
from blender_addon.scene.contents import SWITCHES
from blender_addon.ui import panels
from blender_addon.ui.operators.check import OPERATORS
from blender_addon.ui.operators.render import check_questions, to_ask
from tests.blender.ui.test_panels import draw
from tests.support import panel
from tests.support.panel import fix, problem_of
from tests.support.scenes import MINI, add_box, compositing


def test_a_good_scene_has_no_problems_and_blenders_own_defaults_that_do_no_harm_are_hidden(scene):
    assert [problem for problem in last.check_scene(scene) if problem.severity != "INFO"] == []
    scene.cycles.property_unset("pixel_filter_type")
    scene.cycles.property_unset("use_denoising")
    assert scene.cycles.pixel_filter_type == "BLACKMAN_HARRIS" and scene.cycles.use_denoising
    assert last.check_scene(scene) == []


def test_no_light_and_colors_that_cannot_be_shown(scene):
    scene.collection.objects.unlink(bpy.data.objects["Sun"])
    fix(scene, "light")
    assert scene.world.name == "Light Field World"
    scene.view_settings.use_curve_mapping = scene.view_settings.use_white_balance = True
    assert "curves and white balance" in problem_of(scene, "view").reason and problem_of(scene, "view").asks
    fix(scene, "view")
    scene.world, bpy.data.objects["Box"].is_shadow_catcher = bpy.data.worlds.new("World"), True
    assert "shadow catcher" in problem_of(scene, "catcher").reason
    fix(scene, "catcher")


def test_the_world_of_a_new_file_alone(scene):
    scene.collection.objects.unlink(bpy.data.objects["Sun"])
    scene.world = bpy.data.worlds.new("World")
    assert problem_of(scene, "light") is None and "a dim world" in problem_of(scene, "dark").reason
    for name in ("EVEN", "OWN"):
        scene.lfsr.light = name
        assert (problem_of(scene, "dark") is None) == (name == "EVEN")
    scene.world = None
    assert "will be black" in problem_of(scene, "light").reason
    scene.world, scene.lfsr.light = bpy.data.worlds["World"], "AUTO"
    fix(scene, "dark")


def test_materials_that_do_not_show_are_named(scene):
    material, group = bpy.data.materials.new("Toon"), bpy.data.node_groups.new("Toon", "ShaderNodeTree")
    use_nodes(material)
    material.node_tree.nodes.new("ShaderNodeGroup").node_tree = group
    out, shader = group.nodes.new("NodeGroupOutput"), group.nodes.new("ShaderNodeShaderToRGB")
    group.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    bpy.data.objects["Box"].data.materials.append(material)
    nodes = material.node_tree.nodes
    material.node_tree.links.new(nodes["Group"].outputs[0], nodes["Principled BSDF"].inputs["Base Color"])
    assert problem_of(scene, "eevee") is None, "it leads nowhere"
    group.links.new(shader.outputs[0], out.inputs[0])
    assert "ode Shader to RGB" in problem_of(scene, "eevee").reason and problem_of(scene, "eevee").target == "Toon"
    group.nodes["Shader to RGB"].mute = True
    assert problem_of(scene, "eevee") is None
    material.node_tree.nodes["Material Output"].target = "EEVEE"
    assert "ode Material Output" in problem_of(scene, "eevee").reason
    alpha = material.node_tree.nodes["Principled BSDF"].inputs["Alpha"]
    assert problem_of(scene, "clear") is None
    alpha.default_value = 0.0
    assert problem_of(scene, "clear").target == "Toon" and problem_of(scene, "clear").asks
    material.node_tree.nodes.new("ShaderNodeEmission")
    assert problem_of(scene, "clear") is None, "it may be mixed with another shader"
    (material := bpy.data.materials.new("Scripted")).use_nodes = True
    material.node_tree.nodes.new("ShaderNodeScript")
    bpy.data.objects["Box"].data.materials.append(material)
    assert problem_of(scene, "script").target == "Scripted"
    fix(scene, "script")


def test_a_simulation_without_a_cache_is_named(scene, tmp_path):
    (fluid := bpy.data.objects["Box"].modifiers.new("Fluid", "FLUID")).fluid_type = "DOMAIN"
    fluid.domain_settings.cache_directory = str(tmp_path)
    assert problem_of(scene, "simulation") in to_ask(scene)
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "fluid_data_0001.vdb").touch()
    assert problem_of(scene, "simulation"), "its smoke has hardly begun"
    scene.frame_set(2)
    assert "of frame 2 is not baked" in problem_of(scene, "simulation").reason, "playing a file writes a cache as far"
    (tmp_path / "data" / "fluid_data_0001.vdb").rename(tmp_path / "data" / "fluid_data_0002.vdb")
    assert problem_of(scene, "simulation") is None


def switch_on(switch):
    def spoil(scene):
        collection = bpy.data.collections.new("Set")
        scene.collection.children.link(collection)
        collection.objects.link(bpy.data.objects.new("Chair", bpy.data.objects["Box"].data))
        setattr(scene.view_layers[0].layer_collection.children["Set"], switch, True)
    return spoil


def test_the_only_subject_is_not_background_and_an_empty_collection_no_problem(scene):
    switch_on(SWITCHES[0])(scene)
    assert problem_of(scene, SWITCHES[0])
    bpy.data.objects.remove(bpy.data.objects["Chair"])
    assert problem_of(scene, SWITCHES[0]) is None
    bpy.data.objects["Box"].scale = 60, 60, 60
    bpy.context.view_layer.update()
    assert problem_of(scene, "background") is None
    add_box(scene, (0, 0, 0), (0.1, 0.1, 0.1))
    bpy.context.view_layer.update()
    assert problem_of(scene, "background").target == "Box"


IGNORED = {"filter", "engine", "clamp", "shift"}  # and not asked about


@pytest.mark.parametrize("code, spoil", [
    ("filter", lambda scene: setattr(scene.cycles, "pixel_filter_type", "GAUSSIAN")),
    ("motion", lambda scene: setattr(scene.render, "use_motion_blur", True)),
    ("focus", lambda scene: setattr(scene.camera.data.dof, "use_dof", True)),
    ("engine", lambda scene: setattr(scene.render, "engine", "BLENDER_WORKBENCH")),
    ("shift", lambda scene: setattr(scene.camera.data, "shift_y", 0.1)),
    ("override", lambda scene: setattr(scene.view_layers[0], "material_override", bpy.data.materials.new("Clay"))),
    ("border", lambda scene: setattr(scene.render, "use_border", True)),
    ("aspect", lambda scene: setattr(scene.render, "pixel_aspect_y", 2)),
    ("clamp", lambda scene: setattr(scene.cycles, "sample_clamp_direct", 1)),
    ("world", lambda scene: setattr(scene.view_layers[0], "world_override", bpy.data.worlds.new("Other"))),
    *((switch, switch_on(switch)) for switch in SWITCHES), ("layers", lambda scene: scene.view_layers.new("Second")),
    ("compositor", lambda scene: compositing(scene, "CompositorNodeExposure")),
    ("sequencer", lambda scene: scene.sequence_editor_create().strips.new_effect("x", "COLOR", 1, frame_start=1,
                                                                                 length=10))])
def test_what_renders_leave_out_has_a_button_and_is_asked_before(scene, code, spoil):
    assert problem_of(scene, code) is None
    spoil(scene)
    problem = problem_of(scene, code)
    assert problem.severity == "INFO" and (problem in to_ask(scene)) == (code not in IGNORED)
    fix(scene, code)


@pytest.mark.parametrize(("code", "spoil"), [
    ("subject", lambda scene: setattr(bpy.data.objects["Box"], "hide_render", True)),
    ("rig", lambda scene: bpy.data.objects.remove(rig.plane_of(rig.find(scene)))),
    ("array", lambda scene: bpy.ops.lfsr.array_remove())])
def test_without_a_subject_or_an_array(scene, code, spoil):
    """A broken array is added again."""
    spoil(scene)
    assert (problem_of(scene, code).severity == "INFO") == (code == "array")
    assert code == "rig" or not problem_of(scene, "rig")
    fix(scene, code)


def test_too_little_room(scene, monkeypatch):
    usage, needed = shutil.disk_usage(bpy.app.tempdir), problems.bytes_of_frame(scene_settings.resolve(scene))
    assert needed > 3 * 128 * 96
    for free, codes in ((needed, []), (needed - 1, ["disk"]), (0, ["disk", "temporary"])):
        monkeypatch.setattr(shutil, "disk_usage", lambda _, free=free: usage._replace(free=free))
        seen = [problem for problem in to_ask(scene) if problem.target == "Disk Space"]
        assert [problem.code for problem in seen] == codes
        assert all(problem.code in OPERATORS and problem.severity == "ERROR" for problem in seen)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=10 * needed))
    assert to_ask(scene, 10) == [] and [problem.code for problem in to_ask(scene, 11)] == ["disk"]
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=0))
    assert problems.free(Path(bpy.app.tempdir, "not", "there")) == 0


def test_every_device_traces_all_views_at_once(scene, monkeypatch):
    monkeypatch.setattr(scene_settings, "device_of", lambda scene: "CUDA" if scene.cycles.device == "GPU" else "CPU")
    for scene.cycles.device, layout in (("GPU", "lens-card"), ("CPU", "one-pass")):
        assert scene_settings.resolve(scene).request.layout == layout


def test_textures_that_cannot_be_read_and_unsaved_paint(scene, tmp_path):
    (image := bpy.data.images.new("Paint", 4, 4)).use_fake_user = True
    image.pixels[0] = 0.5
    image.update()
    assert problem_of(scene, "dirty").target == "Paint"
    fix(scene, "dirty")
    gone = bpy.data.images.new("Gone", 4, 4)
    gone.source, gone.filepath = "FILE", "//textures/gone.png"
    (texture := bpy.data.textures.new("Bumps", "IMAGE")).image = gone
    bpy.data.objects["Box"].modifiers.new("Bumps", "DISPLACE").texture = texture
    assert problem_of(scene, "texture").target == "gone.png"
    (tmp_path / "cut.png").write_bytes(b"\x89PNG")
    gone.filepath = str(tmp_path / "cut.png")
    assert "cut.png is damaged" in problem_of(scene, "texture").reason


def test_settings_that_do_not_go_together_and_unknown_problems_are_refused(scene):
    panel.refused("cannot be fixed by a button", bpy.ops.lfsr.check_fix, code="nonsense")
    panel.refused("'Nobody' is not there any more", bpy.ops.lfsr.check_select, target="Nobody")
    scene.lfsr.method, scene.lfsr.scale = "none", "2"
    fix(scene, "display")
    scene.lfsr.display, scene.lfsr.profile_file = "FILE", "//gone.toml"
    fix(scene, "display")


def at_depth(scene, depth: float, half: float, lift: float = 0.0) -> bpy.types.Object:
    """Box centred on the view at ``depth``, ``lift`` half-heights above."""
    placed, matrix = rig.placement(scene, MINI)
    place = np.array(matrix) @ (0, lift * placed.half_height * depth / placed.distance, depth, 1)
    return add_box(scene, tuple(place[:3]), (half, half, half))


@pytest.mark.parametrize("side", ["near", "far"])
def test_outside_the_usable_depth(scene, side):
    placed, _ = rig.placement(scene, MINI)
    near, far = rig.usable_depth(placed, MINI)
    at_depth(scene, near * 0.8 if side == "near" else far * 1.3, placed.half_width * 0.15).name = "Stray"
    scene.objects["Stray"].hide_viewport = True  # renders show it
    problem = problem_of(scene, "depth")
    assert problem.target == "Stray" and problem.is_object and " m" in problem.reason


def test_objects_out_of_sight_are_no_problem_and_walls_become_background_by_one_button(scene):
    placed, _ = rig.placement(scene, MINI)
    at_depth(scene, -placed.distance, 0.1)
    at_depth(scene, placed.distance * 50, 0.1, lift=4)
    bpy.context.view_layer.update()
    assert problem_of(scene, "depth") is None
    _, far = rig.usable_depth(rig.placement(scene, MINI)[0], MINI)
    add_box(scene, (0, 0, -1), (far * 3, far * 3, 0.01)).name = "Floor"
    at_depth(scene, far * 1.5, far * 2).name = "Wall"
    bpy.context.view_layer.update()
    last.check(scene)
    assert rows()["background"].count == 2
    assert bpy.ops.lfsr.check_fix(code="background", target="") == {"FINISHED"} and "background" not in rows()
    assert sorted(item.name for item in bpy.data.collections["Background"].objects) == ["Floor", "Wall"]


def rows() -> dict[str, Problem]:
    return {row.code: row for row in last.rows}


def drawn() -> list[tuple[str, dict]]:
    """The panel with its rows opened."""
    bpy.context.window_manager.lfsr.show_problems = True
    return draw(panels.LFSR_PT_image)


def shown() -> list[str]:
    return [named["text"] for name, named in drawn() if name in ("label", "operator") and "text" in named]


def test_many_objects_that_are_thinner_than_a_view_shows_are_one_row_that_opens(scene):
    placed, _ = rig.placement(scene, MINI)
    width, rods = 0.1 * 2 * placed.half_width / MINI.lenses[0], []
    for number in range(30):
        rods.append(add_box(scene, (0.02 * number - 0.3, 0, 0), (width, width, placed.half_height * 0.5)))
        rods[-1].name = f"Rod {number:02d}"
    bpy.context.view_layer.update()
    last.check(scene)
    row = rows()["thin"]
    assert (row.title, row.count, row.target) == ("30 objects are too thin", 30, "")
    assert row.title in shown() and "Rod 00" not in shown()
    bpy.context.window_manager.lfsr.show_names = True
    opened = shown()
    bpy.context.window_manager.lfsr.show_names = False
    assert opened.count("Rod 00") == 1 and f"and {30 - panels.MOST_NAMES} more" in opened
    for target, selected in (("", sorted(rod.name for rod in rods)), ("Rod 03", ["Rod 03"])):
        assert bpy.ops.lfsr.check_select(code="thin", target=target) == {"FINISHED"}
        assert sorted(item.name for item in bpy.context.selected_objects) == selected
    for rod in rods:
        rod.scale = (15, 15, 1)
    bpy.context.view_layer.update()
    assert problem_of(scene, "thin") is None


def spoil(scene) -> None:
    """Problems of eight kinds."""
    scene.render.use_motion_blur = scene.camera.data.dof.use_dof = scene.render.use_border = True
    scene.camera.data.shift_x, scene.cycles.pixel_filter_type = 0.2, "GAUSSIAN"
    scene.view_layers.new("Second")
    compositing(scene, "CompositorNodeExposure")
    scene.view_layers[0].material_override = bpy.data.materials.new("Clay")


def test_at_most_five_rows_are_shown_at_first_and_each_has_a_button(scene):
    spoil(scene)
    last.check(scene)
    assert len(rows()) == 8 and all(row.fix or row.is_object for row in rows().values())
    boxes = [name for name, _ in drawn() if name == "box"]
    assert len(boxes) == MOST_ROWS and ("prop", "3 More") in [(name, named.get("text")) for name, named in drawn()]
    bpy.context.window_manager.lfsr.all_problems = True
    assert [name for name, _ in drawn()].count("box") == 8
    bpy.context.window_manager.lfsr.all_problems = False


def test_an_artist_is_asked_once_before_a_render(scene):
    assert check_questions(scene) == []
    spoil(scene)
    asked = check_questions(scene)
    assert len(asked) == MOST_ROWS + 1 and asked[-1].sentence == "Scene Check lists 1 more"
    assert any("depth of field" in question.sentence for question in asked)
    assert not any(question.advice for question in asked), "a script goes on without asking"
    asked[0].accept()
    assert check_questions(scene) == []
    scene.view_layers[0].material_override, scene.world, bpy.data.objects["Sun"].hide_render = None, None, True
    assert check_questions(scene) == [], "one of Blender's world images lights it"
    scene.lfsr.light = "OWN"
    assert [question.sentence.startswith("The scene has no light") for question in check_questions(scene)] == [True]


def test_a_change_is_said_until_the_next_check_and_the_rows_of_another_file_are_forgotten(scene, tmp_path):
    last.check(scene)
    assert not last.changed and "Check Again" not in shown()
    scene.render.use_motion_blur = True
    bpy.data.objects["Box"].location.x += 0.1
    bpy.context.view_layer.update()
    assert "Check Again" in shown() and "motion" not in rows(), "nothing is done at once"
    last.check(scene)
    assert not last.changed and "motion" in rows()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "other.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "other.blend"))
    assert bpy.context.window_manager.lfsr.checked_scene == "" and last.problems() == []
