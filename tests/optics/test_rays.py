"""The ray layout by its properties: symmetry, nesting, conventions, lists of lenses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.optics.rays import CameraArray, RayLayout, rays, view_offset
from tests.support.rays import pixel_rays
from tests.support.told import refuses

PROFILE = load_display("mini")
ARRAY = CameraArray.for_display(PROFILE, width=3.0)


def layout(scale: int = 1, **options) -> RayLayout:
    return RayLayout.for_display(PROFILE, ARRAY, scale, **options)


def hits(origin: np.ndarray, direction: np.ndarray, depth: float = ARRAY.distance) -> np.ndarray:
    """Where rays cross the plane z = depth, (..., 2)."""
    return (origin + direction * ((depth - origin[..., 2:]) / direction[..., 2:]))[..., :2]


def views_of(pixels: np.ndarray, views: tuple[int, int]) -> np.ndarray:
    """(H, W, C) -> (sy, sx, py, px, C), independent of lfsr_core.optics.eia."""
    height, width, channels = pixels.shape
    return pixels.reshape(height // views[1], views[1], width // views[0], views[0], channels).swapaxes(1, 2)


def test_array_keeps_the_proportions_of_the_display():
    assert ARRAY.half_height / ARRAY.half_width == pytest.approx(96 / 128)
    assert ARRAY.distance == pytest.approx(3.0 * 180 / 128)
    assert ARRAY.spacing / ARRAY.distance == pytest.approx(PROFILE.camera_spacing_mm / 180)


def test_array_at_a_given_distance_keeps_the_viewing_angle():
    near = CameraArray.for_display(PROFILE, width=3.0, distance=1.0)
    assert near.distance == 1.0
    assert near.spacing == pytest.approx(ARRAY.spacing / ARRAY.distance)


@given(st.integers(1, 100), st.floats(0.01, 10))
def test_centred_views_are_symmetric_about_the_axis(count, spacing):
    offsets = view_offset(np.arange(count), count, spacing)
    np.testing.assert_allclose(offsets, -offsets[::-1], atol=1e-9 * count)
    np.testing.assert_allclose(np.diff(offsets), spacing)


@given(st.integers(1, 20), st.integers(2, 8))
def test_low_view_is_the_centre_of_the_high_views_it_covers(low_count, scale):
    high = view_offset(np.arange(low_count * scale), low_count * scale, 1.0)
    low = view_offset(np.arange(low_count), low_count, float(scale))
    np.testing.assert_allclose(low, high.reshape(low_count, scale).mean(axis=1), atol=1e-9)


@given(st.integers(1, 20).map(lambda n: 2 * n), st.integers(2, 8))
def test_paper_convention_shifts_low_against_high_by_half_s_minus_one(low_count, scale):
    high = view_offset(np.arange(low_count * scale), low_count * scale, 1.0, "paper")
    low = view_offset(np.arange(low_count), low_count, float(scale), "paper")
    shift = high.reshape(low_count, scale).mean(axis=1) - low
    np.testing.assert_allclose(shift, (scale - 1) / 2, atol=1e-9)


def test_rays_start_on_the_camera_plane_with_unit_directions_towards_the_display():
    for convention in ("centred", "paper"):
        origin, direction = pixel_rays(layout(convention=convention))
        assert origin.shape == direction.shape == (96, 128, 3)
        assert not origin[..., 2].any()
        np.testing.assert_allclose(np.linalg.norm(direction, axis=-1), 1)
        assert (direction[..., 2] > 0).all()


def test_whole_layout_is_point_symmetric():
    origin, direction = pixel_rays(layout())
    np.testing.assert_allclose(origin[::-1, ::-1, :2], -origin[..., :2], atol=1e-12)
    np.testing.assert_allclose(direction[::-1, ::-1, :2], -direction[..., :2], atol=1e-12)


def test_centred_pixels_of_a_lens_meet_at_its_centre_on_the_display():
    points = views_of(hits(*pixel_rays(layout())), (8, 8))
    lens_x = ((np.arange(16) + 0.5) / 16 * 2 - 1) * ARRAY.half_width
    lens_y = -((np.arange(12) + 0.5) / 12 * 2 - 1) * ARRAY.half_height
    np.testing.assert_allclose(points[..., 0], np.broadcast_to(lens_x[None, :, None, None], (12, 16, 8, 8)), atol=1e-9)
    np.testing.assert_allclose(points[..., 1], np.broadcast_to(lens_y[:, None, None, None], (12, 16, 8, 8)), atol=1e-9)


def test_pixel_further_right_is_a_camera_further_right_and_row_zero_the_topmost():
    origin = views_of(pixel_rays(layout())[0], (8, 8))
    assert (np.diff(origin[..., 0], axis=3) > 0).all()
    assert (np.diff(origin[..., 1], axis=2) < 0).all()


def test_high_views_nest_in_their_low_view():
    scale = 4
    low = views_of(pixel_rays(layout(scale))[0], (2, 2))
    high = views_of(pixel_rays(layout())[0], (8, 8)).reshape(12, 16, 2, scale, 2, scale, 3)
    np.testing.assert_allclose(high.mean(axis=(3, 5)), low, atol=1e-12)


@given(st.lists(st.floats(0.001, 0.999), min_size=4, max_size=4), st.sampled_from([1, 2, 4]))
def test_every_ray_of_a_pixel_stays_on_its_lens_and_in_its_view_cell(numbers, scale):
    place_x, place_y, random_x, random_y = numbers
    full, (width, height) = layout(scale), layout(scale).size
    column, row = np.meshgrid(np.arange(width), np.arange(height))
    origin, direction = rays(full, (column + place_x) / width, 1 - (row + place_y) / height, random_x, random_y)
    middle = pixel_rays(full)
    cell = full.spacing / 2 * (1 + 1e-6)
    assert np.abs(origin - middle[0]).max() <= cell
    lens_half = np.array([ARRAY.half_width / 16, ARRAY.half_height / 12]) * (1 + 1e-6)
    assert (np.abs(hits(origin, direction) - hits(*middle)) <= lens_half).all()


def test_place_in_the_pixel_is_place_on_the_lens():
    corner = views_of(hits(*pixel_rays(layout(), place=(0.25, 0.75))), (8, 8))
    lens_x = ((np.arange(16) + 0.25) / 16 * 2 - 1) * ARRAY.half_width
    lens_y = -((np.arange(12) + 0.75) / 12 * 2 - 1) * ARRAY.half_height
    np.testing.assert_allclose(corner[..., 0], np.broadcast_to(lens_x[None, :, None, None], (12, 16, 8, 8)), atol=1e-9)
    np.testing.assert_allclose(corner[..., 1], np.broadcast_to(lens_y[:, None, None, None], (12, 16, 8, 8)), atol=1e-9)


def test_random_numbers_move_right_and_up_like_the_raster():
    centre = rays(layout(), 0.5, 0.5, 0.5, 0.5)[0]
    moved = rays(layout(), 0.5, 0.5, 0.75, 0.75)[0]
    assert moved[0] > centre[0]
    assert moved[1] > centre[1]


def test_view_aperture_zero_is_a_point_and_one_the_whole_cell():
    raster = np.full(50, 0.5 / 128), np.full(50, 0.5)
    numbers = np.linspace(0, 1, 50)
    point = rays(layout(view_aperture=0.0), *raster, numbers, numbers)[0]
    assert np.ptp(point, axis=0).max() == 0
    whole = rays(layout(view_aperture=1.0), *raster, numbers, numbers)[0]
    np.testing.assert_allclose(np.ptp(whole, axis=0)[:2], ARRAY.spacing)


@pytest.mark.parametrize("axis", [0, 1])
def test_where_views_differ_along_one_axis_rays_start_on_it(axis):
    views = [[8, 1], [1, 6]][axis]
    lenses = [128 // views[0], 96 // views[1]]
    profile = DisplayProfile.from_dict(PROFILE.to_dict() | {"views": views, "lenses": lenses})
    numbers = np.linspace(0, 1, 64, endpoint=False)
    for scale in (1, 2):
        flat = RayLayout.for_display(profile, ARRAY, scale)
        origin, _ = rays(flat, numbers, numbers[::-1], numbers, 1 - numbers)
        assert not origin[:, 1 - axis].any(), "no parallax and no aperture across"
        assert np.ptp(origin[:, axis]) > flat.spacing / 2
        assert flat.cell[axis] == ARRAY.spacing and flat.cell[1 - axis] == 0


def test_a_view_covers_its_own_cell_whatever_the_scale():
    coarse = layout(8)
    assert coarse.views == (1, 1)
    assert coarse.cell == (ARRAY.spacing, ARRAY.spacing)


def test_paper_target_is_the_pixels_own_place_on_the_panel():
    points = hits(*pixel_rays(layout(convention="paper"), place=(0.0, 0.0)))
    expected = (np.arange(128) / 128 * 2 - 1) * ARRAY.half_width  # Eq. (8)
    np.testing.assert_allclose(points[..., 0], np.broadcast_to(expected, (96, 128)), atol=1e-9)


def test_lens_list_places_the_same_rays_in_tiles():
    chosen = ((11, 3), (0, 15), (5, 5), (5, 6), (7, 0))
    listed = layout(lens_list=chosen)
    assert listed.tiles == (2, 3)
    assert listed.size == (16, 24)
    for whole, tiles in zip(pixel_rays(layout()), pixel_rays(listed), strict=True):
        whole, tiles = views_of(whole, (8, 8)), views_of(tiles, (8, 8)).reshape(6, 8, 8, 3)
        for tile, (row, column) in zip(tiles, chosen, strict=False):
            np.testing.assert_allclose(tile, whole[row, column], atol=1e-12)
        np.testing.assert_array_equal(tiles[5], tiles[4])  # the rest repeats the last lens


@pytest.mark.parametrize(("options", "told"), [
    ({"convention": "centered"}, "convention is 'centered'"),
    ({"view_aperture": 1.5}, "view aperture is 1.5"), ({"lens_list": ()}, "list of lenses is empty"),
    ({"lens_list": ((12, 0),)}, r"lens \(12, 0\) is outside the 12 rows and 16 columns"),
    ({"lens_list": ((0, -1),)}, r"lens \(0, -1\) is outside")])
def test_bad_layout_is_refused(options, told):
    refuses(told, layout, **options)


def test_the_lower_edge_of_a_pixel_belongs_to_it():
    width, height = layout().size
    rows = np.arange(height)
    edge, _ = rays(layout(), np.full(height, 0.5 / width), rows / height)
    middle, _ = rays(layout(), np.full(height, 0.5 / width), (rows + 0.5) / height)
    np.testing.assert_allclose(edge[:, 1], middle[:, 1], atol=1e-12)
