"""A visible world rendered apart from the subject, against one that is rendered with it."""

import bpy
import numpy as np
import pytest

from blender_addon import compat
from blender_addon.render import cycles, frame_folder, output, world
from blender_addon.render.frame_folder import render_job
from lfsr_core.commands.sentences import sentence
from lfsr_core.frames.frame import LOW_RES_FILE, PANEL_FILE, WORLD_FILE, read_frame
from lfsr_core.images import image_files
from lfsr_core.images.image_files import read_png
from lfsr_core.optics.rays import to_elemental_images
from lfsr_core.reconstruct.second_stage import finish_frame
from lfsr_core.reconstruct.upscaler import read_world
from tests.support.panels import cells, hexagonal, psnr, small
from tests.support.requests import make_request
from tests.support.scenes import MINI, WAYS, add_box, add_camera, add_world, emission, link, mixed
from tests.support.told import refuses


@pytest.fixture
def lit_box(scene, monkeypatch):
    """A box in front of a world of stripes that differ by direction, seen by a turned camera."""
    # Saves a tiny render for each frame: the world lights the box.
    monkeypatch.setattr(frame_folder, "light_seen", lambda *_: (np.empty(0), np.empty(0)))
    add_box(scene, (1, 0, 3), (0.5, 0.5, 0.5))
    add_camera(scene, angle=0.9).rotation_euler = (1.4, 0.1, 0.2)
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


def elemental(image):
    return to_elemental_images(image, MINI.lenses)


def test_its_image_holds_what_every_ray_sees(lit_box, tmp_path):
    before, job = lit_box.world, make_request(str(tmp_path / "low"), MINI, scale=4, samples=1)
    render_job(lit_box, job)
    assert lit_box.world == before and not [item for item in bpy.data.worlds if item != before]
    assert [item.name for item in bpy.data.scenes] == [lit_box.name]
    frame = read_frame(job.output)
    assert frame.world_apart and 0 < frame.seconds["world"] < frame.seconds["render"]
    render_job(lit_box, make_request(str(tmp_path / "whole"), MINI, scale=1, samples=64))
    layers = image_files.read_layers(tmp_path / "whole" / "lr_eia.exr")
    free = elemental(layers["color"][..., 3:]).max((2, 3, 4)) == 0
    assert 0.2 < free.mean() < 0.99
    seen = read_world(job.output, frame).elemental_images(np.argwhere(free))
    expected = elemental(layers["environment"])[free]
    assert expected.std() > 0.2
    # One of 64 samples has a standard deviation of about 0.04 where stripes are steepest.
    assert np.abs(seen - expected).mean() < 0.02 and abs((seen - expected).mean()) < 2e-3


def test_the_image_of_another_render_is_used_and_references_have_none_apart(lit_box, tmp_path):
    image_files.write_layers(tmp_path / "image.exr", {"color": np.full((4, 4, 3), 0.25, np.float32)})
    job = make_request(str(tmp_path / "low"), MINI, scale=2, samples=1, lens_list=((3, 5), (6, 9)),
              world=str(tmp_path / "image.exr"))
    render_job(lit_box, job)
    frame = read_frame(job.output)
    assert (tmp_path / "low" / WORLD_FILE).read_bytes() == (tmp_path / "image.exr").read_bytes()
    assert frame.world_apart and frame.seconds["world"] == 0 < frame.seconds["render"]
    assert "environment" in image_files.read_layers(tmp_path / "low" / LOW_RES_FILE)
    for options in ({"kind": "reference"}, {"scale": 1}, {"world_visible": False}):
        with frame_folder.prepared(lit_box, make_request(str(tmp_path), MINI, **options)) as frame:
            assert not frame.world_apart
    lit_box.world = None
    lit_box.collection.objects.link(bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN")))
    refuses("has no world to show",
            render_job, lit_box, make_request(str(tmp_path / "none"), MINI, scale=4, samples=1, world_visible=True))


@pytest.mark.parametrize("way", WAYS)
def test_a_render_says_how_much_of_it_shows(lit_box, tmp_path, way):
    with frame_folder.prepared(lit_box, make_request(str(tmp_path), MINI, samples=4)) as frame:
        shot = cycles.Shot(frame.rays, frame.matrix_world, way)
        hidden, shown = (cycles.RenderSettings(4, world_visible=visible) for visible in (False, True))
        cycles.render_encoded(lit_box, shot, hidden, tmp_path / "hidden.exr")
        with world.white_to_camera(lit_box):
            cycles.render_encoded(lit_box, shot, shown, tmp_path / "shown.exr")
    alone, apart = (image_files.read_layers(tmp_path / f"{name}.exr") for name in ("hidden", "shown"))
    np.testing.assert_allclose(apart["environment"], np.repeat(1 - apart["color"][..., 3:], 3, -1), atol=1e-5)
    assert ((apart["environment"] > 0) & (apart["environment"] < 1)).any()
    # The subject is in the light of the scene's own world.
    np.testing.assert_allclose(apart["color"], alone["color"], atol=1e-5)


def test_a_world_whose_file_is_missing_is_gray_and_white_to_the_camera(lit_box, tmp_path):
    bpy.data.libraries.write(str(tmp_path / "sky.blend"), {lit_box.world})
    (lit_box.world,) = link(tmp_path / "sky.blend", "worlds", [lit_box.world.name])
    (tmp_path / "sky.blend").unlink()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    with world.white_to_camera(bpy.context.scene):
        assert any(node.type == "LIGHT_PATH" for node in bpy.context.scene.world.node_tree.nodes)


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


SAMPLES = 32


@pytest.fixture
def pane(scene):
    """A clear pane of glass in an even grey world, in front of nothing."""
    add_box(scene, (0, 0, 0), (0.5, 0.05, 0.5), mixed(("ShaderNodeBsdfGlass", {"Roughness": 0.0})))
    add_world(scene, 0.5)
    add_camera(scene, (0, -4, 0), 0.3)
    scene.render.film_transparent = True
    return scene


@pytest.mark.parametrize("layout", ["one-pass", "lens-card"])
@pytest.mark.parametrize("through", [False, True])
def test_glass_is_as_transparent_as_in_blenders_render(pane, tmp_path, layout, through):
    pane.cycles.film_transparent_glass = through
    render_job(pane, make_request(str(tmp_path / "out"), MINI, samples=SAMPLES, scale=4, layout=layout))
    middle = image_files.read_layers(tmp_path / "out" / "lr_eia.exr")["color"][9:15, 13:19].mean((0, 1))
    with cycles.cycles_settings(pane, cycles.RenderSettings(SAMPLES, transparent_glass=through), (32, 24)):
        output.render_to(pane, tmp_path / "own.exr")
    blenders = image_files.read_layers(tmp_path / "own.exr")["color"][10:14, 14:18].mean((0, 1))
    assert middle == pytest.approx(blenders, abs=0.02) and (middle[3] < 0.2) == through


def test_glass_before_a_visible_world_is_opaque(pane, tmp_path):
    pane.cycles.film_transparent_glass = True
    render_job(pane, make_request(str(tmp_path / "out"), MINI, samples=SAMPLES, scale=4, world_visible=True))
    color = image_files.read_layers(tmp_path / "out" / "lr_eia.exr")["color"]
    assert color[9:15, 13:19, 3] == pytest.approx(1) and np.isfinite(color).all()


@pytest.mark.parametrize("way", WAYS)
def test_color_and_environment_add_up_to_blenders_own_image(scene, tmp_path, way):
    """The environment layer is already weighted by what is left uncovered."""
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    scene.world = bpy.data.worlds.new("world")
    scene.world.color = (0.3, 0.6, 0.9)
    job = make_request(str(tmp_path), MINI, samples=64)
    with frame_folder.prepared(scene, job) as frame:
        assert frame.world_visible, "a world that Blender would show is shown"
        settings = cycles.RenderSettings(64, world_visible=True)
        with (cycles.encoded_camera(scene, cycles.Shot(frame.rays, frame.matrix_world, way)),
              cycles.cycles_settings(scene, settings, frame.rays.size)):
            output.render_to(scene, tmp_path / "apart.exr")
            scene.render.film_transparent = False
            output.render_to(scene, tmp_path / "whole.exr")
    apart, whole = (image_files.read_layers(tmp_path / f"{name}.exr") for name in ("apart", "whole"))
    assert ((apart["color"][..., 3] > 0.1) & (apart["color"][..., 3] < 0.9)).sum() > 10, "edges are what could go wrong"
    assert apart["color"][..., :3] + apart["environment"] == pytest.approx(whole["color"][..., :3], abs=2e-3)


@pytest.fixture
def waves(scene):
    """Boxes that shine in waves, before and behind the display plane."""
    for place, half in (((-0.3, -0.3, 0), (0.5, 0.1, 0.3)), ((0.5, 0.4, 0.2), (0.4, 0.1, 0.5))):
        tree = add_box(scene, place, half, emission((1, 1, 1))).data.materials[0].node_tree
        where, noise = tree.nodes.new("ShaderNodeNewGeometry"), tree.nodes.new("ShaderNodeTexNoise")
        noise.inputs["Scale"].default_value = 2.0
        tree.links.new(where.outputs["Position"], noise.inputs["Vector"])
        tree.links.new(noise.outputs["Color"], tree.nodes["Emission"].inputs["Color"])
    add_camera(scene, (0, -4, 0), 0.7)
    return scene


def panel(scene, folder, display, **options):
    render_job(scene, make_request(str(folder), display, **{"samples": 16, "scale": 1} | options))
    finish_frame(folder, "none")
    return read_png(folder / PANEL_FILE).astype(float)


@pytest.mark.parametrize(("make", "world"), [(cells, False), (hexagonal, False), (cells, True)])
def test_it_is_the_image_that_is_woven_from_every_view(waves, tmp_path, monkeypatch, make, world):
    """Also without Open Shading Language."""
    display = small(make())
    if world:
        waves.world = bpy.data.worlds.new("world")
        waves.world.color = (0.1, 0.3, 0.7)
        monkeypatch.setattr(compat, "has_osl", lambda: False)
    direct = panel(waves, tmp_path / "direct", display, layout="subpixels", world_visible=world)
    woven = panel(waves, tmp_path / "woven", display, world_visible=world)
    # 24 to 29 dB: what interpolating costs, most of it at the edges of the boxes.
    assert direct.std() > 30 and psnr(direct, woven) > 22
    others = direct[:, ::-1], direct[::-1], np.roll(direct, 1, 1)
    assert max(psnr(other, woven) for other in others) < psnr(direct, woven) - 2, "this can tell"
