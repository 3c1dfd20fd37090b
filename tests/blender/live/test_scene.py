"""The live scene: the artist's through the lens card, following it, and nothing left of it."""

import dataclasses

import bpy
import numpy as np
import pytest

from blender_addon.check.last import check_scene
from blender_addon.live import scene as live_scene
from blender_addon.live import session
from blender_addon.render import cycles, output
from blender_addon.render.cards import CELL
from blender_addon.scene.array import rig
from lfsr_core.frames.frame import SUBPIXELS
from lfsr_core.images import image_files
from lfsr_core.optics.display import write_profile
from lfsr_core.optics.panel.subpixel_rays import panel_image
from lfsr_core.optics.rays import RIM, flip_order
from lfsr_core.reconstruct.upscaler import decode, encode
from tests.support.panels import cells, hexagonal, small
from tests.support.scenes import encoded, snapshot
from tests.support.told import refuses

SIZE = (128, 96)


@pytest.fixture
def shown(scene):
    scene.lfsr.live_scale = "2"
    return live_scene.make(scene, live_scene.view_of(scene, SIZE))


def test_nothing_is_left_nor_changed_also_after_a_failure(scene, monkeypatch):
    before = snapshot()
    live_scene.make(scene, live_scene.view_of(scene, SIZE))
    assert len(bpy.data.scenes) == 2
    now = snapshot()
    assert {key.split(".")[-1] for key in before if now[key] != before[key]} <= {"users"}
    assert {key.split("/")[0] for key in now.keys() - before.keys()} >= {"scenes", "objects", "cameras", "materials"}
    live_scene.remove_all()
    assert snapshot() == before and not [group for group in bpy.data.node_groups if group.name.startswith("LFSR")]
    monkeypatch.setattr(live_scene, "new_camera", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        live_scene.make(scene, live_scene.view_of(scene, SIZE))
    assert snapshot() == before


def test_it_renders_the_low_resolution_eia_in_panel_order(scene, shown, tmp_path):
    """The viewport's Cycles cannot run here; the same scene, rendered at the low resolution, is the array's EIA."""
    view = live_scene.view_of(scene, SIZE)
    placed, layout = rig.placement(scene, view.region.profile), view.layout
    direct = encoded(scene, layout, tmp_path, placed[1], "lens-card", samples=32)["color"]
    live = rendered(shown, layout.size, 32, tmp_path)
    difference = np.abs(live - flip_order(direct, layout.lenses)).mean()
    assert difference < 0.25 * np.abs(live - direct).mean(), "elemental images are flipped"
    assert difference < 0.02
    first = next(item for item in shown.objects if item.type == "MESH").data.attributes[CELL].data[0].vector
    assert tuple(first) == pytest.approx((4, 4), abs=1.01 * RIM), "the upper left corner shows the last view"


def rendered(shown, size, samples, folder):
    """``shown`` with one pixel per view."""
    path, settings = folder / "live.exr", cycles.RenderSettings(samples)
    with cycles.cycles_settings(shown, settings, size):
        output.render_to(shown, path)
    return image_files.read_layers(path)["color"]


def test_it_follows_the_array_world_frame_and_colours(scene, shown):
    array, camera = rig.find(scene), shown.camera
    for place in ((1.0, 2.0, 3.0), (-4.0, 0.5, 0.0)):
        array.location, array.rotation_euler, array.scale = place, (0.3, place[0], 1), (2, 2, 2)
        bpy.context.view_layer.update()
        shown.view_layers[0].update()
        ours, theirs = camera.matrix_world, array.matrix_world.normalized()
        assert np.allclose(ours.to_3x3(), theirs.to_3x3(), atol=1e-5)
        behind = theirs.inverted() @ ours.translation
        assert np.allclose(behind[:2], 0, atol=1e-4) and 0 < behind[2] < 0.01
    scene.world, scene.view_settings.exposure = bpy.data.worlds.new("another"), 1.5
    scene.cycles.max_bounces = 3
    scene.frame_set(7)
    live_scene.follow(shown)
    assert shown.world == scene.world and shown.frame_current == 7
    assert shown.view_settings.exposure == 1.5 and shown.cycles.max_bounces == 3
    assert shown.render.preview_pixel_size == "2" and shown.cycles.pixel_filter_type == "BOX"


def test_it_is_lit_as_the_image(scene, shown):
    scene.render.film_transparent, scene.world = False, bpy.data.worlds.new("own")
    for light, kind, count in (("CITY", "worlds", 1), ("EVEN", "lights", 4), ("OWN", "worlds", 0)):
        scene.lfsr.light = light
        live_scene.follow(shown)
        live_scene.show(shown, live_scene.view_of(scene, (300, 200)))
        assert sum(item in live_scene.marked() for item in getattr(bpy.data, kind)) == count
        assert (shown.world != scene.world) == shown.render.film_transparent == (light == "CITY")
        assert shown.cycles.diffuse_bounces == (0 if light == "EVEN" else 4)
    scene.lfsr.light, scene.world = "AUTO", None
    bpy.data.batch_remove([item for item in scene.objects if item.type == "LIGHT"])
    live_scene.follow(shown)
    assert shown.world in live_scene.marked(), "a scene without light gets some"
    live_scene.remove_all()
    assert (len(bpy.data.images), len(bpy.data.lights), len(bpy.data.worlds)) == (0, 1, 1)


def test_a_region_of_another_size_keeps_the_card_in_the_middle_and_rays_are_per_pixel_of_the_display(scene, shown):
    live_scene.show(shown, live_scene.view_of(scene, (301, 200)))
    assert (shown.render.resolution_x, shown.render.resolution_y) == (301, 200)
    assert shown.render.use_border and shown.render.border_max_x == pytest.approx(300.5 / 301)
    assert shown.camera.data.shift_x == pytest.approx(-live_scene.view_of(scene, (301, 200)).region.shift[0] / 301)
    samples = {}
    for values in (("2", 16, 0), ("4", 16, 0), ("4", 0, 0), ("4", 16, 5)):
        scene.lfsr.live_scale, scene.lfsr.live_rays, scene.lfsr.live_samples = values
        live_scene.follow(shown)
        samples[values] = shown.cycles.preview_samples
    assert list(samples.values()) == [64, 256, 0, 5]


def test_one_eye_beside_the_panel(scene, shown):
    """A scene of its own, as fine as the window allows, moved by the sliders without touching the panel's."""
    view = live_scene.view_of(scene, (300, 200), live_scene.EYE)
    eye = live_scene.make(scene, view)
    assert {item[live_scene.MARK] for item in live_scene.marked()} == {"panel", "eye"}
    assert eye.render.preview_pixel_size == "8" and shown.render.preview_pixel_size == "2"
    before, cells = shown.camera, cell_of(eye)
    scene.lfsr.live_eye_right, scene.lfsr.live_eye_up = 0.6, -0.6
    moved = live_scene.view_of(scene, (300, 200), live_scene.EYE)
    assert moved != view
    live_scene.show(eye, moved)
    assert cell_of(eye)[0] > cells[0] and cell_of(eye)[1] > cells[1], "views count rightwards and downwards"
    live_scene.remove_all(live_scene.EYE)
    assert shown.camera == before and {item[live_scene.MARK] for item in live_scene.marked()} == {"panel"}


def cell_of(live):
    return tuple(next(item for item in live.objects if item.type == "MESH").data.attributes[CELL].data[0].vector)


@pytest.mark.parametrize("make", [pytest.param(cells, marks=pytest.mark.long), hexagonal])
def test_a_panel_with_a_lens_sheet_shows_its_subpixels(scene, tmp_path, make):
    """The panel's image as direct subpixel rendering makes it, from a pixel per pixel."""
    display = dataclasses.replace(small(make()), panel_pixels=(72, 48), panel_mm=(36.0, 24.0))
    write_profile(tmp_path / "own.toml", display)
    scene.lfsr.display, scene.lfsr.profile_file, scene.lfsr.live_scale = "FILE", str(tmp_path / "own.toml"), "4"
    before, view = snapshot(), live_scene.view_of(scene, display.panel_pixels)
    shown = live_scene.make(scene, view)
    assert shown.render.preview_pixel_size == "1" and view.region.sentence() is None
    assert "dirty" not in {problem.code for problem in check_scene(scene)}
    live = rendered(shown, display.panel_pixels, 128, tmp_path)[..., :3]
    traced = encoded(scene, view.layout, tmp_path, rig.placement(scene, display)[1], SUBPIXELS, samples=128)["color"]
    image = panel_image(view.layout, traced[..., :3])
    difference = np.abs(live - image).mean()
    others = image[::-1], image[:, ::-1], image[..., ::-1], np.roll(image, 1, 1)
    assert difference < 0.5 * min(np.abs(live - other).mean() for other in others)
    assert live.mean((0, 1)) == pytest.approx(image.mean((0, 1)), rel=0.01)
    first = rendered(shown, display.panel_pixels, 1, tmp_path)[..., :3]
    assert first.mean((0, 1)) == pytest.approx(image.mean((0, 1)), rel=0.1), "the first sample has no tint"
    live_scene.remove_all()
    assert snapshot() == before


def test_a_lens_sheet_has_an_eye_too_and_without_an_array_to_follow_there_is_no_view(scene):
    scene.lfsr.display, scene.lfsr.live_scale = "looking-glass-go", "2"
    assert live_scene.view_of(scene, (4000, 3000), live_scene.EYE).eye[2] > 0
    rig.find(scene).scale.y = -1
    bpy.context.view_layer.update()
    refuses("mirrored by a negative scale", live_scene.view_of, scene, SIZE)
    bpy.ops.lfsr.array_remove()
    refuses("needs a camera array", live_scene.view_of, scene, SIZE)


def test_file_of_a_crash_is_tidied(scene, shown, tmp_path):
    path = tmp_path / "crash.blend"
    assert not session.is_on()
    bpy.data.libraries.write(str(path), {scene, shown})
    with bpy.data.libraries.load(str(path)) as (source, target):
        target.scenes = source.scenes
    assert len([one for one in bpy.data.scenes if live_scene.MARK in one]) == 2
    session._tidy()
    assert not live_scene.marked()


def test_save_in_the_middle_keeps_it_out_of_the_file(scene, shown, tmp_path):
    path = tmp_path / "saved.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    with bpy.data.libraries.load(str(path)) as (source, _):
        names = [name for kind in ("scenes", "objects", "materials", "node_groups", "meshes", "cameras")
                 for name in getattr(source, kind)]
    assert names and not [name for name in names if name.startswith("LFSR")]


@pytest.mark.skipif(not live_scene.can_interpolate(), reason="this Blender's compositor cannot interpolate")
def test_encoding_is_the_second_stages():
    values = np.geomspace(1e-4, 50, 40, dtype=np.float32)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    tried = {"encode": (live_scene._encode, encode, values), "decode": (live_scene._decode, decode, encode(values))}
    for name, (fill, wanted, given) in tried.items():
        tree = live_scene._scalar(name, fill)
        assert [evaluate(tree, float(value)) for value in given] == pytest.approx(list(wanted(given)), rel=1e-4)


OPERATIONS = {"MINIMUM": min, "MAXIMUM": max, "SQRT": lambda x: x**0.5, "POWER": pow, "MULTIPLY": lambda x, y: x * y,
              "LOGARITHM": lambda x, base: np.log(x) / np.log(base), "EXPONENT": np.exp,
              "MULTIPLY_ADD": lambda x, y, z: x * y + z}


def evaluate(tree, value):
    """What a tree of Math nodes makes of ``value``."""
    def of(socket):
        if not socket.is_linked:
            return socket.default_value
        node = socket.links[0].from_node
        if node.bl_idname == "NodeGroupInput":
            return value
        return OPERATIONS[node.operation](*[of(item) for item in node.inputs if item.enabled])
    return of(next(node for node in tree.nodes if node.bl_idname == "NodeGroupOutput").inputs[0])
