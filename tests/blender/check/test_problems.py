"""The scene check: each cause is found and named, and its button removes it."""

from __future__ import annotations

import bpy
import pytest

from blender_addon.check import problems
from blender_addon.settings import scene_settings
from lfsr_core.optics.display import load_display
from tests.support.problems import fix, found

MINI = load_display("mini")


def test_a_good_scene_has_no_problems(scene):
    assert [problem for problem in problems.check_scene(scene) if problem.severity != "INFO"] == []


def test_no_light(scene):
    scene.collection.objects.unlink(bpy.data.objects["Sun"])
    fix(scene, "light")
    assert scene.world.name == "Light Field World"


def test_the_world_of_a_new_file_alone(scene):
    scene.collection.objects.unlink(bpy.data.objects["Sun"])
    scene.world = bpy.data.worlds.new("World")
    assert found(scene, "light") is None and "almost dark" in found(scene, "dim").reason
    for name, code in (("EVEN", None), ("OWN", "dim")):
        scene.lfsr.light = name
        assert (found(scene, "dim") is None) == (code is None)
    scene.world = None
    assert "will be black" in found(scene, "light").reason
    scene.world, scene.lfsr.light = bpy.data.worlds["World"], "AUTO"
    fix(scene, "dim")


@pytest.mark.parametrize("code, spoil", [
    ("filter", lambda scene: setattr(scene.cycles, "pixel_filter_type", "BLACKMAN_HARRIS")),
    ("denoiser", lambda scene: setattr(scene.cycles, "use_denoising", True)),
    ("motion", lambda scene: setattr(scene.render, "use_motion_blur", True)),
    ("focus", lambda scene: setattr(scene.camera.data.dof, "use_dof", True)),
    ("engine", lambda scene: setattr(scene.render, "engine", "BLENDER_WORKBENCH"))])
def test_settings_that_are_ignored(scene, code, spoil):
    assert found(scene, code) is None
    spoil(scene)
    assert found(scene, code).severity == "INFO"
    fix(scene, code)


def test_every_device_traces_all_views_at_once(scene, monkeypatch):
    monkeypatch.setattr(scene_settings, "device_of", lambda scene: "CUDA" if scene.cycles.device == "GPU" else "CPU")
    scene.cycles.device = "GPU"
    assert found(scene, "device") is None
    assert scene_settings.resolve(scene).layout == "lens-card"
    scene.cycles.device = "CPU"
    assert scene_settings.resolve(scene).layout == "one-pass"


def test_material_that_needs_osl(scene):
    material = bpy.data.materials.new("Scripted")
    material.use_nodes = True
    material.node_tree.nodes.new("ShaderNodeScript")
    bpy.data.objects["Box"].data.materials.append(material)
    assert found(scene, "script").target == "Scripted"
    fix(scene, "script")


def test_missing_texture_and_unsaved_paint(scene):
    image = bpy.data.images.new("Paint", 4, 4)
    image.use_fake_user = True
    image.pixels[0] = 0.5
    image.update()
    assert found(scene, "dirty").target == "Paint"
    fix(scene, "dirty")
    gone = bpy.data.images.new("Gone", 4, 4)
    gone.source, gone.filepath = "FILE", "//textures/gone.png"
    assert found(scene, "texture").target == "gone.png"


def test_no_array_then_add(scene):
    bpy.ops.lfsr.array_remove()
    assert found(scene, "array").severity == "ERROR"
    fix(scene, "array")


def test_what_renders_leave_out_is_listed(scene):
    assert found(scene, "ignored") is None
    scene.sequence_editor_create().strips.new_effect("x", "COLOR", 1, frame_start=1, length=10)
    scene.camera.data.shift_x = 0.1
    reasons = [problem.reason for problem in problems.check_scene(scene) if problem.code == "ignored"]
    assert ["shift" in reason for reason in reasons] == [True, False] and "sequencer" in reasons[1]


def test_the_list_in_the_panel(scene):
    scene.cycles.use_denoising = True
    assert bpy.ops.lfsr.check_scene() == {"FINISHED"}
    state = bpy.context.window_manager.lfsr
    assert state.checked_scene == scene.name
    assert "denoiser" in [line.code for line in state.problems]


def test_unknown_problems_and_objects_are_refused(scene):
    with pytest.raises(RuntimeError, match="cannot be fixed by a button"):
        bpy.ops.lfsr.check_fix(code="nonsense")
    with pytest.raises(RuntimeError, match="'Nobody' is not there any more"):
        bpy.ops.lfsr.check_select(target="Nobody")
