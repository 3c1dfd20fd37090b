"""The user is told of everything that changes the image."""

import bpy
import pytest

from blender_addon.scene.notices import SWITCHES, left_out
from lfsr_core.base.notices import Notice
from tests.support.scenes import add_box, add_camera, compositing


@pytest.fixture
def plain(scene):
    add_box(scene, (0, 0, 0), (1, 1, 1))
    add_camera(scene)
    return scene


def test_a_plain_scene_has_no_notices(plain):
    assert left_out(plain) == []


def test_camera_shift_is_not_honoured_and_said(plain):
    plain.camera.data.shift_y = 0.25
    assert left_out(plain) == [Notice("shift-ignored", {"camera": plain.camera.name, "x": 0, "y": 0.25})]


def test_a_material_override_is_named(plain):
    plain.view_layers[0].material_override = bpy.data.materials.new("clay")
    (notice,) = left_out(plain)
    assert (notice.code, notice.values["material"]) == ("override-ignored", "clay")


@pytest.mark.parametrize("switch", SWITCHES)
def test_collections_that_a_view_layer_treats_its_own_way(plain, switch):
    inner = bpy.data.collections.new("inner")
    plain.collection.children.link(inner)
    setattr(plain.view_layers[0].layer_collection.children["inner"], switch, True)
    assert left_out(plain) == [], "nothing in it would be seen"
    inner.objects.link(plain.objects["item"])
    (notice,) = left_out(plain)
    assert notice == Notice("collections-switched", {"layer": plain.view_layers[0].name, "switch": switch,
                                                     "names": ["inner"]})


def test_other_view_layers_are_left_out_and_said(plain):
    plain.view_layers.new("beauty")
    (notice,) = left_out(plain)
    assert (notice.code, notice.values["names"]) == ("layers-left-out", ["beauty"])


def test_compositor_nodes_that_change_the_image_are_said(plain):
    tree_nodes = compositing(plain, "CompositorNodeExposure", "NodeReroute", "CompositorNodeBrightContrast")
    assert left_out(plain) == [Notice("compositor-ignored", {"names": ["Brightness/Contrast", "Exposure"]})]
    tree_nodes[0].mute = True
    assert left_out(plain)[0].values["names"] == ["Brightness/Contrast"]
    plain.render.use_compositing = False
    assert left_out(plain) == [], "F12 leaves it out too"


def test_compositor_that_passes_the_render_on_is_not_said(plain):
    compositing(plain, "NodeReroute").pop().id_data.nodes.new("CompositorNodeExposure")
    assert left_out(plain) == []


def test_strips_of_the_sequencer_are_said(plain):
    strip = plain.sequence_editor_create().strips.new_effect("x", "COLOR", 1, frame_start=1, length=10)
    assert left_out(plain) == [Notice("sequencer-ignored")]
    strip.mute = True
    assert left_out(plain) == []
    strip.mute, plain.render.use_sequencer = False, False
    assert left_out(plain) == []


def test_python_that_was_not_run_is_said(plain, tmp_path):
    plain.camera.driver_add("location", 0).driver.expression = "__import__('os').getpid() * 0"
    path = tmp_path / "driven.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path), use_scripts=False)
    bpy.context.scene.frame_set(2)
    assert "scripts-off" in [notice.code for notice in left_out(bpy.context.scene)]
