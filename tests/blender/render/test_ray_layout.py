"""Every pixel's ray, decoded from a scene that shows its own world position, against rays.py."""

import bpy
import mathutils
import numpy as np
import pytest

from blender_addon.scene.array import rig
from lfsr_core.optics import eia
from lfsr_core.optics.rays import RayLayout, view_offset
from tests.support.rays import pixel_rays
from tests.support.scenes import (
    ARRAY,
    FLAT,
    MINI,
    POSITION_OFFSET,
    TURNED,
    WAYS,
    add_plane,
    encoded,
    fresh_scene,
    position_emission,
)
from tests.support.told import refuses

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
    """World hit points (H, W, 3) of rays.py's pixel-centre rays on the plane."""
    return where_they_meet(plane, *pixel_rays(layout, CENTRE))


def shown_hits(scene, layout, folder, **settings):
    color = encoded(scene, layout, folder, ARRAY_TO_WORLD.tolist(), **settings)["color"]
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


def test_position_layer_is_the_pixel_centre_ray(scene, tmp_path, way):
    layout, plane = layout_of(2), plane_in_array(2 * ARRAY.distance, 0.3)
    add_plane(scene, plane, position_emission())
    layers = encoded(scene, layout, tmp_path, ARRAY_TO_WORLD.tolist(), way, layers=("position",))
    assert np.abs(layers["position"] - expected_hits(layout, plane)).max() <= TOLERANCE


@pytest.mark.parametrize("lenses", [LENSES, LENSES[:1], ALL_LENSES])
def test_listed_lenses_are_the_same_lenses_of_the_whole(scene, tmp_path, lenses, way):
    whole, listed = layout_of(), layout_of(lens_list=lenses)
    add_plane(scene, plane_in_array(ARRAY.distance, 0.4), position_emission())
    tiles = eia.to_elemental_images(shown_hits(scene, listed, tmp_path, way=way), listed.tiles)
    every = eia.to_elemental_images(shown_hits(scene, whole, tmp_path, way=way), whole.lenses)
    tiles = tiles.reshape(-1, *tiles.shape[2:])
    for number, (row, column) in enumerate(lenses):
        assert np.abs(tiles[number] - every[row, column]).max() <= TOLERANCE
    assert np.abs(tiles[len(lenses):] - every[lenses[-1]]).max(initial=0) <= TOLERANCE, "filler repeats the last lens"


@pytest.mark.parametrize(("scale", "aperture"), [(2, 1.0), (4, 2.0), (4, 0.0)])
def test_samples_fill_the_lens_and_the_cell_of_views(tmp_path, scale, aperture, way):
    """Second moments of the hit points at twice the distance: 2·target − origin, both uniform in their boxes."""
    layout = layout_of(scale, view_aperture=aperture)
    moments = []
    for square in (False, True):
        scene = fresh_scene()
        # In array space itself, so that x and y are not mixed by the turn.
        add_plane(scene, mathutils.Matrix.Translation((0, 0, -2 * ARRAY.distance)), position_emission(square))
        looking_down = rig.from_blender(mathutils.Matrix())
        moments.append(encoded(scene, layout, tmp_path, looking_down, way, samples=256)["color"][..., :2])
    mean = moments[0] - POSITION_OFFSET
    variance = (moments[1] - mean**2).mean((0, 1))
    lens = np.array([2 * ARRAY.half_width / MINI.lenses[0], 2 * ARRAY.half_height / MINI.lenses[1]])
    expected = (4 * lens**2 + (ARRAY.spacing * aperture) ** 2) / 12
    assert variance == pytest.approx(expected, rel=0.02)
    centres = view_offset(np.arange(layout.views[0]), layout.views[0], layout.spacing)
    views = eia.to_views(mean, layout.lenses)[..., 0].mean((0, 2, 3))
    assert views == pytest.approx(-centres, abs=0.01 * layout.spacing)


def test_image_too_small_for_blender_is_refused(scene, tmp_path):
    add_plane(scene, plane_in_array(ARRAY.distance, 0.0), position_emission())
    refuses("2×2 pixels, but Blender needs at least 4", encoded, scene, layout_of(4, lens_list=LENSES[:1]), tmp_path)


def test_normal_layer_is_in_array_space(scene, tmp_path, way):
    """+X right, +Y up, +Z towards the display: what faces the viewer has a negative z."""
    tilt = 0.3
    plane = TURNED @ mathutils.Matrix.Translation((0, 0, -ARRAY.distance)) @ mathutils.Matrix.Rotation(tilt, 4, "Y")
    add_plane(scene, plane, bpy.data.materials.new("plain"))
    normal = encoded(scene, layout_of(4), tmp_path, ARRAY_TO_WORLD.tolist(), way, layers=("normal",))["normal"]
    assert normal == pytest.approx(np.broadcast_to((np.sin(tilt), 0, -np.cos(tilt)), normal.shape), abs=1e-3)
