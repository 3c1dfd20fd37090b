"""A shader that does not compile is an error, never the shader before it."""

import contextlib
import dataclasses
import re
import sys

import bpy
import mathutils
import numpy as np
import pytest

from blender_addon.compat import overridden
from blender_addon.render import cycles, output
from blender_addon.render.cards import card_camera
from blender_addon.scene.array import rig
from lfsr_core.frames.frame import SUBPIXELS
from lfsr_core.images import image_files
from lfsr_core.optics.panel.subpixel_rays import PanelLayout
from lfsr_core.optics.rays import CameraArray, RayLayout, to_elemental_images, to_views, view_offset
from tests.support import scenes
from tests.support.card_rays import pixel_rays
from tests.support.panels import SHEETS, large, lenticular
from tests.support.reference_rays import panel_rays
from tests.support.scenes import ARRAY, FLAT, MINI, POSITION_OFFSET, TURNED, WAYS, add_plane, encoded, position_emission
from tests.support.small_disk import on_a_small_disk
from tests.support.told import refuses

GOOD = cycles.SOURCE.read_text()


@pytest.mark.parametrize("broken", ["shader", GOOD.replace("place_x", "misspelled", 1), GOOD.replace("}", "", 1), ""])
def test_broken_shader_is_an_error_and_not_the_last_good_one(scene, broken):
    camera = bpy.data.cameras.new("camera")
    cycles.set_shader(camera, GOOD, {"spacing": 0.5})
    refuses("rejected the ray-layout shader.*lens-card", cycles.set_shader, camera, broken, {"spacing": 1.5})
    assert camera.cycles_custom["spacing"] == 0.5, "neither half of it is set"


@pytest.mark.skipif(sys.platform == "win32", reason="needs a POSIX limit on file size")
@pytest.mark.parametrize("room", [-1, 9000])
def test_a_full_temporary_folder_is_not_called_a_missing_camera(room):
    told = on_a_small_disk(len(GOOD) + room, "import bpy, signal\nsignal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
                           "from blender_addon.render import cycles\ncycles.compile_osl(cycles.SOURCE.read_text())")
    assert re.search(r"refused: \S*lfsr-osl\S* cannot be written \(File too large\): free some space", told), told


def test_every_parameter_of_the_shader_is_set_and_no_other_nor_one_of_an_older_layout(scene):
    layout = RayLayout.for_display(MINI, ARRAY, lens_list=((1, 2), (3, 4)))
    interface = GOOD[GOOD.index("shader ray_layout("):GOOD.index("output point")]
    declared = {line.split("=")[0].split()[-1] for line in interface.splitlines() if "=" in line}
    assert set(cycles.layout_parameters(layout)) == declared
    camera = bpy.data.cameras.new("camera")
    camera.cycles_custom["left_over"] = 1.0
    cycles.set_shader(camera, cycles.layout_source(layout), cycles.layout_parameters(layout))
    assert "left_over" not in camera.cycles_custom


TOLERANCE = 1e-5 * ARRAY.distance
# Cycles reads the pixel filter from a table of 1024 steps, which puts the pixel's centre half a step up and right.
CENTRE = (0.5 + 0.5 / 1024, 0.5 - 0.5 / 1024)
ARRAY_TO_WORLD = np.array(rig.from_blender(TURNED))
LENSES = ((0, 0), (11, 15), (3, 7), (7, 3), (5, 5))
ALL_LENSES = tuple((row, column) for row in range(MINI.lenses[1]) for column in range(MINI.lenses[0]))


def layout_of(scale=1, display=MINI, **options):
    return RayLayout.for_display(display, ARRAY, scale, **{"view_aperture": 0.0} | options)


def plane_in_array(depth, tilt):
    """Blender matrix of a plane at ``depth`` on the array's axis, tilted about both of its axes."""
    turn = mathutils.Euler((tilt, tilt / 2, 0)).to_matrix().to_4x4()
    return TURNED @ mathutils.Matrix.Translation((0, 0, -depth)) @ turn


def where_they_meet(plane, origin, direction):
    """World points (H, W, 3) where rays of an array at ARRAY_TO_WORLD, in array space, meet the plane."""
    origin = origin @ ARRAY_TO_WORLD[:3, :3].T + ARRAY_TO_WORLD[:3, 3]
    direction = direction @ ARRAY_TO_WORLD[:3, :3].T
    normal, point = np.array(plane.col[2].to_3d()), np.array(plane.translation)
    return origin + direction * (((point - origin) @ normal) / (direction @ normal))[..., None]


def expected_hits(layout, plane):
    """World hit points (H, W, 3) of reference_rays.py's pixel-centre rays on the plane."""
    return where_they_meet(plane, *pixel_rays(layout, CENTRE))


def shown_hits(scene, layout, folder, matrix_world=None, **settings):
    color = encoded(scene, layout, folder, matrix_world or ARRAY_TO_WORLD.tolist(), **settings)["color"]
    assert (color[..., 3] == 1).all(), "a ray missed the plane, which fills the view"
    return color[..., :3] - POSITION_OFFSET


@pytest.fixture(params=WAYS)
def way(request):
    return request.param


@pytest.mark.parametrize(("options", "depth", "tilt"), [
    ({}, 1.0, 0.0), ({}, 1.0, 0.5), ({"scale": 2}, 0.7, -0.2), ({"scale": 4}, 3.0, 0.2),
    ({"convention": "paper"}, 0.7, -0.2), ({"convention": "paper", "scale": 4}, 0.7, -0.2),
    ({"display": FLAT, "scale": 2}, 1.0, 0.0), ({"display": FLAT, "scale": 2, "view_aperture": 1.0}, 1.0, 0.0)])
def test_every_pixel_hits_where_rays_py_says(scene, tmp_path, options, depth, tilt, way):
    """On the display plane also with an aperture where there is no vertical parallax."""
    layout, plane = layout_of(**options), plane_in_array(depth * ARRAY.distance, tilt)
    add_plane(scene, plane, position_emission())
    error = np.linalg.norm(shown_hits(scene, layout, tmp_path, way=way) - expected_hits(layout, plane), axis=-1)
    assert error.max() <= TOLERANCE, f"{error.max() / ARRAY.distance:.1e} of the distance"


@pytest.mark.parametrize("lenses", [LENSES, LENSES[:1], ALL_LENSES])
def test_listed_lenses_are_the_same_lenses_of_the_whole(scene, tmp_path, lenses, way):
    whole, listed = layout_of(), layout_of(lens_list=lenses)
    add_plane(scene, plane_in_array(ARRAY.distance, 0.4), position_emission())
    tiles = to_elemental_images(shown_hits(scene, listed, tmp_path, way=way), listed.tiles)
    every = to_elemental_images(shown_hits(scene, whole, tmp_path, way=way), whole.lenses)
    tiles = tiles.reshape(-1, *tiles.shape[2:])
    for number, (row, column) in enumerate(lenses):
        assert np.abs(tiles[number] - every[row, column]).max() <= TOLERANCE
    assert np.abs(tiles[len(lenses):] - every[lenses[-1]]).max(initial=0) <= TOLERANCE, "filler repeats the last lens"


@pytest.mark.parametrize(("scale", "aperture"), [(2, 1.0), (4, 2.0), (4, 0.0)])
def test_samples_fill_the_lens_and_the_cell_of_views(tmp_path, scale, aperture, way):
    """Second moments of the hit points at twice the distance: 2·target − origin, both uniform in their boxes."""
    layout, moments = layout_of(scale, view_aperture=aperture), []
    for square in (False, True):
        scene = scenes.fresh_scene()
        # In array space itself, so that x and y are not mixed by the turn.
        add_plane(scene, mathutils.Matrix.Translation((0, 0, -2 * ARRAY.distance)), position_emission(square))
        looking_down = rig.from_blender(mathutils.Matrix())
        moments.append(encoded(scene, layout, tmp_path, looking_down, way, samples=256)["color"][..., :2])
    mean = moments[0] - POSITION_OFFSET
    variance = (moments[1] - mean**2).mean((0, 1))
    lens = np.array([2 * ARRAY.half_width / MINI.lenses[0], 2 * ARRAY.half_height / MINI.lenses[1]])
    assert variance == pytest.approx((4 * lens**2 + (ARRAY.spacing * aperture) ** 2) / 12, rel=0.02)
    centres = view_offset(np.arange(layout.views[0]), layout.views[0], layout.spacing)
    assert to_views(mean, layout.lenses)[..., 0].mean((0, 2, 3)) == pytest.approx(-centres, abs=0.01 * layout.spacing)


def test_blender_without_osl_says_what_to_do_and_too_small_an_image_is_refused(scene, tmp_path, monkeypatch):
    add_plane(scene, plane_in_array(ARRAY.distance, 0.0), position_emission())
    refuses("2×2 pixels, but Blender needs at least 4", encoded, scene, layout_of(4, lens_list=LENSES[:1]), tmp_path)
    import _cycles

    monkeypatch.setattr(_cycles, "with_osl", False)
    refuses("built without OSL.*lens-card", cycles.compile_osl, GOOD)
    monkeypatch.undo()
    (folder := tmp_path / "a\nb").mkdir()
    monkeypatch.setattr(cycles.tempfile, "TemporaryDirectory", lambda **_: contextlib.nullcontext(folder))
    assert "\nb/camera" not in cycles.compile_osl(GOOD), "a line break in the folder's name"


def test_position_and_normal_layer_are_of_the_pixel_centre_ray_in_world_and_array_space(scene, tmp_path, way):
    """Normals: +X right, +Y up, +Z towards the display: what faces the viewer has a negative z."""
    layout, tilt = layout_of(2), 0.3
    plane = TURNED @ mathutils.Matrix.Translation((0, 0, -2 * ARRAY.distance)) @ mathutils.Matrix.Rotation(tilt, 4, "Y")
    add_plane(scene, plane, bpy.data.materials.new("plain"))
    layers = encoded(scene, layout, tmp_path, ARRAY_TO_WORLD.tolist(), way, layers=("position", "normal"))
    assert np.abs(layers["position"] - expected_hits(layout, plane)).max() <= TOLERANCE
    np.testing.assert_allclose(layers["normal"] - (np.sin(tilt), 0, -np.cos(tilt)), 0, atol=1e-3)


MIRRORED = lenticular(subpixels={"stripes": "bgr"})
MIRRORED = dataclasses.replace(
    MIRRORED, lenticular=dataclasses.replace(MIRRORED.lenticular, flip=(True, True), reversed=True))
DISPLAYS = {**{name: make() for name, make in SHEETS.items()}, "mirrored": MIRRORED,
            "white": lenticular(subpixels={"stripes": "white"})}


def small(display):
    """Fewer of its pixels, of the same pitch."""
    return dataclasses.replace(display, panel_pixels=(48, 32), panel_mm=(24.0, 16.0), viewing_distance_mm=60.0)


@pytest.mark.parametrize("name", DISPLAYS)
def test_every_subpixel_hits_where_panel_rays_says(scene, tmp_path, name):
    display = small(DISPLAYS[name])
    array = CameraArray.for_display(display, 2.0)
    layout, plane = PanelLayout(display, array, aperture=0.0), plane_in_array(0.7 * array.distance, 0.2)
    add_plane(scene, plane, position_emission())
    (width, height), (right, down) = layout.size, CENTRE
    across, up = np.meshgrid((np.arange(width) + right) / width, 1 - (np.arange(height) + down) / height)
    expected = where_they_meet(plane, *panel_rays(layout, across, up))
    error = np.linalg.norm(shown_hits(scene, layout, tmp_path, way=SUBPIXELS) - expected, axis=-1)
    assert error.max() <= 2e-5 * array.distance, f"{error.max() / array.distance:.1e} of the distance"


@pytest.mark.parametrize("name", ["cells", "hexagonal"])
def test_samples_fill_the_subpixel_and_the_lens(scene, tmp_path, name):
    """Beyond the plane of the lenses, where both count: as far around the middle as in reference_rays.py."""
    display = small(DISPLAYS[name])
    array = CameraArray.for_display(display, 2.0)
    layout, looking_down = PanelLayout(display, array), rig.from_blender(mathutils.Matrix())
    means, depth = [], 2 * array.distance
    for square in (False, True):
        for item in list(scene.collection.objects):
            bpy.data.objects.remove(item)
        add_plane(scene, mathutils.Matrix.Translation((0, 0, -depth)), position_emission(square))
        means.append(shown_hits(scene, layout, tmp_path, looking_down, way=SUBPIXELS, samples=64)[..., :2])
    variance = means[1] + POSITION_OFFSET - means[0] ** 2
    # Of most subpixels: some lie behind two lenses.
    assert np.median(variance, (0, 1)) == pytest.approx(np.median(spread(layout, depth), (0, 1)), rel=0.05)


def spread(layout, depth):
    """Variance (H, W, 2) of where the rays of pixels pass a plane, in reference_rays.py."""
    (width, height), random = layout.size, np.random.default_rng(0)
    draws = random.random((4, 64, height, width))
    origin, direction = panel_rays(layout, (np.arange(width) + draws[0]) / width,
                                   1 - (np.arange(height)[:, None] + draws[1]) / height, draws[2], draws[3])
    return (origin + direction / direction[..., 2:] * depth)[..., :2].var(0)


@pytest.mark.parametrize("shown", [(0, 0), (1, 1)])
def test_at_the_corner_of_an_8k_panel_the_phase_is_right_to_a_thousandth_of_a_cylinder(scene, tmp_path, shown):
    """In single precision, 1,400 cylinders, the array turned and moved; the camera plane shows the phase."""
    display = large(cells=False)
    layout = PanelLayout(display, CameraArray.for_display(display, 2.0), aperture=0.0)
    plane, size = plane_in_array(0.05 * layout.array.distance, 0.0), np.array((96, 24))
    add_plane(scene, plane, position_emission())
    first = (np.array(layout.size) - size) * shown
    ends, path = [(first + extra) / layout.size for extra in (0.01, size + 0.01)], tmp_path / "corner.exr"
    with (card_camera(scene, layout, ARRAY_TO_WORLD.tolist()),
          cycles.cycles_settings(scene, cycles.RenderSettings(1), layout.size),
          overridden(scene.render, {"use_border": True, "use_crop_to_border": True, "border_min_x": ends[0][0],
                                    "border_min_y": ends[0][1], "border_max_x": min(1, ends[1][0]),
                                    "border_max_y": min(1, ends[1][1])})):
        output.render_to(scene, path)
    hits = image_files.read_layers(path)["color"][..., :3] - POSITION_OFFSET
    rows, columns = np.indices(hits.shape[:2])
    error = hits - where_they_meet(plane, *panel_rays(layout, (first[0] + columns + CENTRE[0]) / layout.size[0],
                                                      (first[1] + len(hits) - rows - CENTRE[1]) / layout.size[1]))
    phase = error @ ARRAY_TO_WORLD[:3, 0] / (display.views[0] * layout.array.spacing)
    beside = bpy.app.version >= (5, 3, 0)  # rays that a rounding puts on the next cylinder
    assert hits.shape[:2] == (24, 96) and (np.abs(phase) >= 1e-3).sum() <= beside, "of one cylinder"
