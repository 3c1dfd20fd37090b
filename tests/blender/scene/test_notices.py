"""The user is told of everything that changes the image."""

from __future__ import annotations

import bpy
import pytest

from blender_addon.scene.notices import missing_images, notices
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
    (sentence,) = notices(plain)
    assert sentence == f"The linked file {library} is missing and is left out"


def test_every_missing_udim_tile_is_named(plain, tmp_path):
    image = bpy.data.images.new("skin", 8, 8, tiled=True)
    image.tiles.new(1002)
    image.filepath = str(tmp_path / "skin.<UDIM>.png")
    assert missing_images() == [str(tmp_path / "skin.1001.png"), str(tmp_path / "skin.1002.png")]
    (tmp_path / "skin.1001.png").touch()
    assert missing_images() == [str(tmp_path / "skin.1002.png")]


def test_camera_shift_is_not_honoured_and_said(plain):
    plain.camera.data.shift_y = 0.25
    (sentence,) = notices(plain)
    assert "shift (0, 0.25) is ignored" in sentence


def test_a_material_override_is_named(plain):
    plain.view_layers[0].material_override = bpy.data.materials.new("clay")
    (sentence,) = notices(plain)
    assert "material override 'clay'" in sentence


@pytest.mark.parametrize(("switch", "does"), [("exclude", "excludes"), ("holdout", "holds out"),
                                              ("indirect_only", "makes indirect-only")])
def test_collections_that_a_view_layer_treats_its_own_way(plain, switch, does):
    inner = bpy.data.collections.new("inner")
    plain.collection.children.link(inner)
    setattr(plain.view_layers[0].layer_collection.children["inner"], switch, True)
    assert notices(plain) == [], "nothing in it would be seen"
    inner.objects.link(plain.objects["item"])
    (sentence,) = notices(plain)
    assert f"{does} inner" in sentence


def test_other_view_layers_are_left_out_and_said(plain):
    plain.view_layers.new("beauty")
    (sentence,) = notices(plain)
    assert sentence.endswith("without beauty")


def test_compositor_nodes_that_change_the_image_are_said(plain):
    tree_nodes = compositing(plain, "CompositorNodeExposure", "NodeReroute", "CompositorNodeBrightContrast")
    (sentence,) = notices(plain)
    assert sentence.startswith("Compositor nodes (Brightness/Contrast, Exposure) are not applied")
    tree_nodes[0].mute = True
    assert "(Brightness/Contrast)" in notices(plain)[0]
    plain.render.use_compositing = False
    assert notices(plain) == [], "F12 leaves it out too"


def test_compositor_that_passes_the_render_on_is_not_said(plain):
    compositing(plain, "NodeReroute").pop().id_data.nodes.new("CompositorNodeExposure")
    assert notices(plain) == []


def test_strips_of_the_sequencer_are_said(plain):
    strip = plain.sequence_editor_create().strips.new_effect("x", "COLOR", 1, frame_start=1, length=10)
    assert "sequencer's strips are not rendered" in notices(plain)[0]
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
    sentences = notices(bpy.context.scene)
    assert any("did not run the Python" in sentence for sentence in sentences)


def test_missing_images_are_named(tmp_path):
    save_box(tmp_path / "scene.blend", (0, 0, 0), (1, 1, 1))
    material = emission((1, 1, 1))
    texture = material.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = bpy.data.images.new("lost", 4, 4)
    texture.image.source, texture.image.filepath = "FILE", str(tmp_path / "lost.png")
    assert missing_images() == [str(tmp_path / "lost.png")]
