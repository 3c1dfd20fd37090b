"""Scenes of the parameter sweeps: the value is in them, as large as it says, and nothing else changes."""

import math

import bpy
import numpy as np
import pytest

from blender_addon.render.frame_folder import render_job
from blender_addon.scene import contents, light
from blender_addon.scene.array import rig
from blender_addon.scene.files import open_scene, unreadable
from lfsr_core.base.system import read_json, write_json
from lfsr_core.cli import main
from lfsr_core.frames.frame import read_frame
from lfsr_core.images.image_files import read_layers
from lfsr_core.optics.display import write_profile
from lfsr_core.reconstruct.upscaler import foreground_mask
from lfsr_lab.experiments.sweeps.records import SWEEPS
from lfsr_lab.scenes.sweeps import builders
from lfsr_lab.scenes.sweeps.space import Space, card_of_motion, hole
from lfsr_lab.scenes.sweeps.stage import Stage
from tests.support.processes import run_script
from tests.support.requests import make_request
from tests.support.scenes import TINY as DISPLAY

SCALE, FRAMES = 4, 6
SPACE = Space.of(DISPLAY, SCALE)


@pytest.fixture
def built():
    """Function that builds the scene of one sweep and value in this Blender."""
    def build(sweep, value):
        builders.BUILDERS[sweep](Stage.empty(DISPLAY, SCALE, FRAMES), value)
        bpy.context.view_layer.update()
        for world in bpy.data.worlds:  # or its light is prepared for seconds
            world.cycles.sampling_method, world.cycles.sample_map_resolution = "MANUAL", 64
        return bpy.context.scene

    return build


def points(item):
    """World vertices (n, 3) of a mesh object."""
    local, matrix = np.array([vertex.co for vertex in item.data.vertices]), np.array(item.matrix_world)
    return local @ matrix[:3, :3].T + matrix[:3, 3]


def meshes(scene, name):
    items = [item for item in scene.objects if item.type == "MESH" and item.name.startswith(name)]
    assert items, [item.name for item in scene.objects]
    return items


def shader(item, kind="BSDF_PRINCIPLED"):
    return next(node for node in item.data.materials[0].node_tree.nodes if node.type == kind)


@pytest.mark.parametrize("sweep", SWEEPS, ids=lambda sweep: sweep.name)
def test_every_scene_has_the_array_of_the_display_and_light(built, sweep):
    """So there is a builder for every sweep."""
    for value in (sweep.values[0], sweep.values[-1]):
        scene = built(sweep.name, value)
        array, matrix = rig.placement(scene, DISPLAY)
        assert (array.half_width, array.half_height) == pytest.approx((4, 3), rel=1e-5)
        assert (array.distance, array.spacing) == pytest.approx((SPACE.distance, SPACE.spacing), rel=1e-5)
        assert np.array(matrix)[:3, 3] == pytest.approx([0, -SPACE.distance, 0], abs=1e-4)
        assert np.array(matrix)[:3, 2] == pytest.approx([0, 1, 0], abs=1e-6), "looks along +Y"
        assert light.has_light(scene) and contents.find_subject(scene) and not unreadable(scene)
        assert scene.render.film_transparent


@pytest.mark.parametrize("pixels", [2, 1 / 8])
def test_wires_are_as_thick_as_the_sweep_says(built, pixels):
    y = SPACE.depth(0.5)
    for wire in meshes(built("wire", pixels), "wire"):
        at = points(wire)
        along = at[16:].mean(0) - at[:16].mean(0)  # from ring to ring
        along /= np.linalg.norm(along)
        off = at - at.mean(0)
        radius = np.linalg.norm(off - np.outer(off @ along, along), axis=1)
        assert 2 * radius == pytest.approx(np.full(len(radius), pixels * SPACE.footprint(y)), rel=1e-4)
        assert at.mean(0)[1] == pytest.approx(y, rel=1e-5)


@pytest.mark.parametrize("usable", [1.5, 0])
def test_bodies_stand_at_the_sweeps_depth_and_fill_what_the_views_see(built, usable):
    first, second = ([item.data.materials[0].name.split(".")[0]
                      for item in meshes(built("depth-behind", depth), "body")] for depth in (0, 1))
    assert set(first) == set(second) and len(second) >= len(first), "a body only changes its depth along the sweep"
    items, y = meshes(built("depth-behind", usable), "body"), SPACE.depth(usable)
    assert {round(item.location.y, 4) for item in items} == {round(y, 4)}
    sizes = {round(item.scale.x / SPACE.magnified(y), 5) for item in items}
    assert len(sizes) == 1, "alike, seen from the viewing position"
    reach = np.abs([item.location for item in items]).max(0)
    assert (reach[[0, 2]] >= np.array(SPACE.window(y)) - 2 * SPACE.magnified(y)).all()


def test_bodies_gratings_glass_and_tiles_are_those_of_the_sweep(built):
    depths = [item.location.y for item in meshes(built("depth-range", 1.5), "body")]
    front, behind = SPACE.depth(-1.5), SPACE.depth(1.5)
    assert front <= min(depths) < 0.8 * front and 0.8 * behind < max(depths) <= behind
    assert {item.location.y for item in meshes(built("depth-range", 0), "body")} == {0}
    depths = [item.location.y for item in meshes(built("samples", 1), "body")]
    assert SPACE.depth(-0.5) <= min(depths) < 0 < max(depths) <= SPACE.depth(0.5)
    board = meshes(built("texture", 1.5), "grating")[0]
    factors = [node.inputs[1].default_value for node in board.data.materials[0].node_tree.nodes
               if node.type == "MATH" and node.operation == "MULTIPLY" and not node.inputs[1].is_linked]
    y = SPACE.depth(1)
    turns = 2 * math.pi * 1.5 * SPACE.nyquist(y)
    assert sorted(factors) == pytest.approx(sorted([turns, turns, 0.4]), rel=1e-5)
    assert board.location.y == pytest.approx(y, rel=1e-5)
    inputs = shader(meshes(built("glass-roughness", 0.4), "body")[0]).inputs
    assert [inputs[name].default_value for name in ("IOR", "Roughness", "Transmission Weight")] == \
        pytest.approx([1.45, 0.4, 1])
    for width in (3, 0.75):
        scene = built("glass-texture", width)
        board = meshes(scene, "tiles")[0]
        tile = width * SPACE.magnified(board.location.y)
        assert list(shader(board, "MAPPING").inputs["Scale"].default_value) == pytest.approx([1 / tile] * 3)
        assert shader(meshes(scene, "body")[0]).inputs["Roughness"].default_value == 0


def test_the_mirror_shows_its_board_and_flakes_are_as_many_as_the_sweep_says(built):
    scene = built("mirror", 1.5)
    mirror, shown = meshes(scene, "mirror")[0], meshes(scene, "shown")[0]
    normal = np.array(mirror.matrix_world.to_3x3() @ mirror.data.polygons[0].normal)
    assert points(mirror).mean(0) == pytest.approx([0, 0, 0], abs=1e-5)
    at = points(shown)
    image, y = at - 2 * np.outer(at @ normal, normal), SPACE.depth(1.5)
    assert image[:, 1] == pytest.approx(np.full(len(at), y), rel=1e-4), "the mirror image faces the viewer"
    assert np.abs(image[:, [0, 2]]).max(0) == pytest.approx(1.15 * np.array(SPACE.window(y)), rel=1e-4)
    assert not shown.visible_camera and shown.visible_glossy
    for per_lens in (1, 16):
        corners = points(meshes(built("glitter", per_lens), "flakes")[0]).reshape(-1, 4, 3)
        y = corners.mean(1)[:, 1]
        assert SPACE.depth(-0.3) <= y.min() and y.max() <= SPACE.depth(0.3)
        size = np.array([SPACE.magnified(place) for place in y])
        sides = np.linalg.norm(np.diff(corners, axis=1), axis=-1) / size[:, None]
        assert sides == pytest.approx(np.full(sides.shape, 0.12), rel=1e-3), "squares, alike from the viewing position"
        seen = np.abs(corners.mean(1)[:, [0, 2]] / size[:, None]) < np.array(DISPLAY.lenses) / 2
        assert seen.all(1).sum() / math.prod(DISPLAY.lenses) == pytest.approx(per_lens, rel=0.35)


def test_lamps_borders_specks_and_the_eyes_board_are_those_of_the_sweep(built):
    lamps = [item.data for item in built("caustics", 15).objects if item.type == "LIGHT"]
    assert [math.degrees(lamp.angle) for lamp in lamps] == pytest.approx([15])
    powers = []
    for pixels in (1 / 2, 1 / 32):
        scene = built("lamps", pixels)
        assert all(max(shader(body).inputs["Base Color"].default_value[:3]) < 0.05 for body in meshes(scene, "body"))
        ball = meshes(scene, "lamp")[0]
        radius = np.linalg.norm(points(ball) - np.array(ball.location), axis=1).max()
        assert radius == pytest.approx(pixels * SPACE.footprint(0), rel=1e-3)
        powers.append(shader(ball).inputs["Emission Strength"].default_value * radius**2)
    assert powers[0] == pytest.approx(powers[1], rel=1e-2)
    board = meshes(built("border", 0.5), "tiles")[0]
    checker = shader(board, "TEX_CHECKER")
    bright, dark = (checker.inputs[name].default_value[0] for name in ("Color1", "Color2"))
    assert (bright - dark) / (bright + dark) == pytest.approx(0.5) and dark == pytest.approx(0.05)
    mapping = shader(board, "MAPPING")
    assert list(mapping.inputs["Scale"].default_value) == [1, 1, 1]
    assert list(mapping.inputs["Location"].default_value) == [0, 0.5, 0], "an even number of lenses"
    assert board.location.y == 0
    assert SPACE.slope(meshes(built("eye", 2), "print")[0].location.y) == pytest.approx(2, rel=1e-4)
    for speck in meshes(built("recall", 1 / 4), "speck"):
        radius = np.linalg.norm(points(speck) - np.array(speck.location), axis=1).max()
        assert 2 * radius == pytest.approx(SPACE.footprint(speck.location.y) / 4, rel=1e-2)


@pytest.mark.parametrize("fraction", [1, 0.02])
def test_the_foregrounds_fraction_is_that_of_the_hole(built, tmp_path, fraction):
    render_job(built("share", fraction), make_request(str(tmp_path), DISPLAY, scale=SCALE, samples=4))
    frame, layers = read_frame(tmp_path), read_layers(tmp_path / "lr_eia.exr")
    columns, rows = hole(DISPLAY.lenses, fraction)
    mask = foreground_mask(layers, DISPLAY.lenses)
    assert ("index" in frame.layers) == (fraction < 1)
    assert mask.sum() == pytest.approx(columns * rows, abs=2 if fraction == 1 else 0)
    assert abs(columns * rows / 48 - fraction) < 0.02


def test_the_ground_is_as_bright_as_the_sweep_says_and_no_foreground(built, tmp_path):
    scene = built("background", 1)
    assert [group.name for group in meshes(scene, "ground")[0].users_collection] == [contents.BACKGROUND_COLLECTION]
    ratio = [shader(meshes(built("background", brightness), "ground")[0]).inputs["Emission Strength"].default_value
             for brightness in (1 / 4, 1)]
    assert ratio[1] / ratio[0] == pytest.approx(4)
    render_job(bpy.context.scene, make_request(str(tmp_path), DISPLAY, scale=SCALE, samples=4))
    assert 0.2 < foreground_mask(read_layers(tmp_path / "lr_eia.exr"), DISPLAY.lenses).mean() < 0.95


def test_the_card_steps_by_whole_lenses_and_its_print_goes_with_it(built):
    scene = built("motion", 1)
    card = meshes(scene, "card")[0]
    y, half, path = card_of_motion(SPACE, 1, FRAMES)
    places = [scene.frame_set(frame) or np.array(card.location) for frame in range(1, FRAMES + 1)]
    steps = np.diff(places, axis=0) / SPACE.magnified(y)
    assert steps[:, 1] == pytest.approx(np.zeros(FRAMES - 1), abs=1e-5)
    assert steps[:, [0, 2]] == pytest.approx(np.diff(path, axis=0) * [1, -1], abs=1e-4)
    assert np.abs(points(card) - places[-1]).max(0)[[0, 2]] == pytest.approx(half, rel=1e-5)
    assert scene.frame_end == FRAMES
    assert all(item.location.y > y + 1 for item in meshes(scene, "body")), "nothing before the card"


def test_the_script_writes_files_that_hold_all_they_need(tmp_path):
    """An impossible depth is reported and leaves no file."""
    wire, eye = (tmp_path / name / "scene.blend" for name in ("wire", "eye"))
    scenes = [{"name": "wire", "value": 1, "path": str(wire)}, {"name": "eye", "value": 50, "path": str(eye)}]
    job = {"display": DISPLAY.to_dict(), "scale": SCALE, "frames": FRAMES, "scenes": scenes}
    write_json(tmp_path / "job.json", job)
    code, (*_, message) = run_script("sweep_scenes.py", tmp_path / "job.json")
    assert (code, message["stage"]) == (2, "error") and "slope of 50" in message["message"] and not eye.exists()
    assert [item.name for item in wire.parent.iterdir()] == ["scene.blend"]
    scene = open_scene(wire)
    assert rig.find(scene) is not None and meshes(scene, "wire")
    assert all(image.packed_file for image in bpy.data.images if image.source == "FILE")


@pytest.mark.slow
def test_the_suite_runs_from_scene_to_page(tmp_path):
    write_profile(tmp_path / "tiny.toml", DISPLAY)
    assert main(["study", "stress", "-o", str(tmp_path / "out"), "--display", str(tmp_path / "tiny.toml"), "--quick",
                 "--reference-spp", "8", "--sweeps", "samples", "--methods", "bilinear"]) == 0
    sweep = read_json(tmp_path / "out" / "stress.json", "the report")["dials"][0]
    quality = {(cell["value"], cell["method"]): cell["metrics"]["ssim_eia_fg"] for cell in sweep["cells"]}
    assert quality[64, "bicubic"] > quality[1, "bicubic"] + 0.05
    assert sweep["breaks"]["bicubic"]["value"] in (16, 1) and (tmp_path / "out" / "samples" / "reference").is_dir()
