"""The user is told of everything that changes the image."""

import bpy
import pytest

from blender_addon.scene.notices import SWITCHES, missing_images, notices
from lfsr_core.base.notices import Notice
from tests.support.scenes import add_box, add_camera, compositing, emission, save_box


@pytest.fixture
def plain(scene):
    add_box(scene, (0, 0, 0), (1, 1, 1))
    add_camera(scene)
    return scene


def test_a_plain_scene_has_no_notices(plain):
    assert notices(plain) == []


def test_a_missing_library_is_named(plain, tmp_path):
    library = tmp_path / "library.blend"
    bpy.data.libraries.write(str(library), set(bpy.data.meshes))
    with bpy.data.libraries.load(str(library), link=True) as (there, here):
        here.meshes = there.meshes
    assert notices(plain) == []
    library.unlink()
    assert notices(plain) == [Notice("libraries-missing", {"count": 1, "first": str(library)})]


def test_every_missing_udim_tile_is_named(plain, tmp_path):
    image = bpy.data.images.new("skin", 8, 8, tiled=True)
    image.tiles.new(1002)
    image.filepath = str(tmp_path / "skin.<UDIM>.png")
    assert missing_images() == [str(tmp_path / "skin.1001.png"), str(tmp_path / "skin.1002.png")]
    (tmp_path / "skin.1001.png").touch()
    assert missing_images() == [str(tmp_path / "skin.1002.png")]


def test_camera_shift_is_not_honoured_and_said(plain):
    plain.camera.data.shift_y = 0.25
    assert notices(plain) == [Notice("shift-ignored", {"camera": plain.camera.name, "x": 0, "y": 0.25})]


def test_a_material_override_is_named(plain):
    plain.view_layers[0].material_override = bpy.data.materials.new("clay")
    (notice,) = notices(plain)
    assert (notice.code, notice.values["material"]) == ("override-ignored", "clay")


@pytest.mark.parametrize("switch", SWITCHES)
def test_collections_that_a_view_layer_treats_its_own_way(plain, switch):
    inner = bpy.data.collections.new("inner")
    plain.collection.children.link(inner)
    setattr(plain.view_layers[0].layer_collection.children["inner"], switch, True)
    assert notices(plain) == [], "nothing in it would be seen"
    inner.objects.link(plain.objects["item"])
    (notice,) = notices(plain)
    assert notice == Notice("collections-switched", {"layer": plain.view_layers[0].name, "switch": switch,
                                                     "names": ["inner"]})


def test_other_view_layers_are_left_out_and_said(plain):
    plain.view_layers.new("beauty")
    (notice,) = notices(plain)
    assert (notice.code, notice.values["names"]) == ("layers-left-out", ["beauty"])


def test_compositor_nodes_that_change_the_image_are_said(plain):
    tree_nodes = compositing(plain, "CompositorNodeExposure", "NodeReroute", "CompositorNodeBrightContrast")
    assert notices(plain) == [Notice("compositor-ignored", {"names": ["Brightness/Contrast", "Exposure"]})]
    tree_nodes[0].mute = True
    assert notices(plain)[0].values["names"] == ["Brightness/Contrast"]
    plain.render.use_compositing = False
    assert notices(plain) == [], "F12 leaves it out too"


def test_compositor_that_passes_the_render_on_is_not_said(plain):
    compositing(plain, "NodeReroute").pop().id_data.nodes.new("CompositorNodeExposure")
    assert notices(plain) == []


def test_strips_of_the_sequencer_are_said(plain):
    strip = plain.sequence_editor_create().strips.new_effect("x", "COLOR", 1, frame_start=1, length=10)
    assert notices(plain) == [Notice("sequencer-ignored")]
    strip.mute = True
    assert notices(plain) == []
    strip.mute, plain.render.use_sequencer = False, False
    assert notices(plain) == []


def test_python_that_was_not_run_is_said(plain, tmp_path):
    plain.camera.driver_add("location", 0).driver.expression = "__import__('os').getpid() * 0"
    path = tmp_path / "driven.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path), use_scripts=False)
    bpy.context.scene.frame_set(2)
    assert "scripts-off" in [notice.code for notice in notices(bpy.context.scene)]


def test_missing_images_are_named(tmp_path):
    save_box(tmp_path / "scene.blend", (0, 0, 0), (1, 1, 1))
    material = emission((1, 1, 1))
    texture = material.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = bpy.data.images.new("lost", 4, 4)
    texture.image.source, texture.image.filepath = "FILE", str(tmp_path / "lost.png")
    assert missing_images() == [str(tmp_path / "lost.png")]
