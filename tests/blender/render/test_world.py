"""A visible world rendered apart from the subject, against one that is rendered with it."""

import bpy
import numpy as np
import pytest

from blender_addon.render import cycles, frame_folder, world
from lfsr_core.base.errors import LfsrError
from lfsr_core.commands.sentences import sentence
from lfsr_core.frames.frame import LOW_RES_FILE, WORLD_FILE, read_frame
from lfsr_core.frames.low_res import read_world
from lfsr_core.images import exr
from lfsr_core.optics.eia import to_elemental_images
from tests.support.requests import make_request
from tests.support.scenes import MINI, WAYS, add_box, add_camera


@pytest.fixture
def lit_box(scene, monkeypatch):
    """A box in front of a world of stripes that differ by direction, seen by a turned camera."""
    # Saves a tiny render for each frame: the world lights the box.
    monkeypatch.setattr(frame_folder, "is_dark", lambda *_: False)
    add_box(scene, (1, 0, 3), (0.5, 0.5, 0.5))
    camera = add_camera(scene, angle=0.9)
    camera.rotation_euler = (1.4, 0.1, 0.2)
    bpy.context.view_layer.update()
    scene.world = bpy.data.worlds.new("world")
    scene.world.cycles.sampling_method, scene.world.cycles.sample_map_resolution = "MANUAL", 64  # or seconds are spent
    tree = scene.world.node_tree or setattr(scene.world, "use_nodes", True) or scene.world.node_tree
    background = next(node for node in tree.nodes if node.type == "BACKGROUND")
    place, wave = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeVectorMath")
    scale = tree.nodes.new("ShaderNodeVectorMath")
    scale.operation, scale.inputs["Scale"].default_value, wave.operation = "SCALE", 20.0, "SINE"
    tree.links.new(place.outputs["Generated"], scale.inputs[0])
    tree.links.new(scale.outputs["Vector"], wave.inputs[0])
    # Light below 0 is none, and would be cut off wherever it is.
    add = tree.nodes.new("ShaderNodeVectorMath")
    add.inputs[1].default_value = (1.1, 1.1, 1.1)
    tree.links.new(wave.outputs["Vector"], add.inputs[0])
    tree.links.new(add.outputs["Vector"], background.inputs["Color"])
    return scene


def test_no_world_cannot_show(lit_box, tmp_path):
    lit_box.world = None
    lit_box.collection.objects.link(bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN")))
    with pytest.raises(LfsrError, match="has no world to show"):
        frame_folder.render_job(lit_box, make_request(str(tmp_path / "low"), MINI, scale=4, samples=1,
                                                      world_visible=True))


def elemental(image):
    return to_elemental_images(image, MINI.lenses)


def test_its_image_holds_what_every_ray_sees(lit_box, tmp_path):
    before = lit_box.world
    job = make_request(str(tmp_path / "low"), MINI, scale=4, samples=1)
    frame_folder.render_job(lit_box, job)
    assert lit_box.world == before and not [item for item in bpy.data.worlds if item != before]
    assert [item.name for item in bpy.data.scenes] == [lit_box.name]
    frame = read_frame(job.output)
    assert frame.world_apart and 0 < frame.seconds["world"] < frame.seconds["render"]
    whole = make_request(str(tmp_path / "whole"), MINI, scale=1, samples=64)
    frame_folder.render_job(lit_box, whole)
    layers = exr.read_layers(tmp_path / "whole" / "lr_eia.exr")
    free = elemental(layers["color"][..., 3:]).max((2, 3, 4)) == 0
    assert 0.2 < free.mean() < 0.99
    seen = read_world(job.output, frame).elemental_images(np.argwhere(free))
    expected = elemental(layers["environment"])[free]
    assert expected.std() > 0.2
    # One of 64 samples has a standard deviation of about 0.04 where stripes are steepest.
    assert np.abs(seen - expected).mean() < 0.02 and abs((seen - expected).mean()) < 2e-3


def test_the_image_of_another_render_is_used_as_it_is(lit_box, tmp_path):
    exr.write_layers(tmp_path / "image.exr", {"color": np.full((4, 4, 3), 0.25, np.float32)})
    job = make_request(str(tmp_path / "low"), MINI, scale=2, samples=1, lens_list=((3, 5), (6, 9)),
              world=str(tmp_path / "image.exr"))
    frame_folder.render_job(lit_box, job)
    frame = read_frame(job.output)
    assert (tmp_path / "low" / WORLD_FILE).read_bytes() == (tmp_path / "image.exr").read_bytes()
    assert frame.world_apart and frame.seconds["world"] == 0 < frame.seconds["render"]
    assert "environment" in exr.read_layers(tmp_path / "low" / LOW_RES_FILE)


@pytest.mark.parametrize("way", WAYS)
def test_a_render_says_how_much_of_it_shows(lit_box, tmp_path, way):
    with frame_folder.prepared(lit_box, make_request(str(tmp_path), MINI, samples=4)) as frame:
        shot = cycles.Shot(frame.rays, frame.matrix_world, way)
        hidden, shown = (cycles.RenderSettings(4, world_visible=visible) for visible in (False, True))
        cycles.render_encoded(lit_box, shot, hidden, tmp_path / "hidden.exr")
        with world.white_to_camera(lit_box):
            cycles.render_encoded(lit_box, shot, shown, tmp_path / "shown.exr")
    alone, apart = (exr.read_layers(tmp_path / f"{name}.exr") for name in ("hidden", "shown"))
    np.testing.assert_allclose(apart["environment"], np.repeat(1 - apart["color"][..., 3:], 3, -1), atol=1e-5)
    assert ((apart["environment"] > 0) & (apart["environment"] < 1)).any()
    # The subject is in the light of the scene's own world.
    np.testing.assert_allclose(apart["color"], alone["color"], atol=1e-5)


def volume(scene):
    tree = scene.world.node_tree
    output = tree.get_output_node("CYCLES")
    tree.links.new(tree.nodes.new("ShaderNodeVolumeScatter").outputs[0], output.inputs["Volume"])


def window(scene):
    tree = scene.world.node_tree
    place = next(node for node in tree.nodes if node.type == "TEX_COORD")
    tree.links.new(place.outputs["Window"], tree.nodes.new("ShaderNodeVectorMath").inputs[0])


def sun(scene):
    lamp = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    lamp.visible_camera = True
    scene.collection.objects.link(lamp)


@pytest.mark.parametrize("change", [volume, window, sun])
def test_what_no_direction_says_is_rendered_with_the_subject(lit_box, tmp_path, change):
    change(lit_box)
    said = []
    with frame_folder.prepared(lit_box, make_request(str(tmp_path), MINI), said.append) as frame:
        assert frame.world_visible and not frame.world_apart
    assert "so the world is rendered with the subject" in sentence(said[-1])


def test_references_and_hidden_worlds_have_none_apart(lit_box, tmp_path):
    for options in ({"kind": "reference"}, {"scale": 1}, {"world_visible": False}):
        with frame_folder.prepared(lit_box, make_request(str(tmp_path), MINI, **options)) as frame:
            assert not frame.world_apart
