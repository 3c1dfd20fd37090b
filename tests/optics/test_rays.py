"""The ray layout by its properties, and the lens card, whose quads and sums give the same rays."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfsr_core.optics import rays
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.optics.rays import RIM, CameraArray, RayLayout
from lfsr_core.optics.world_view import WorldImage, WorldView
from tests.support import reference_rays
from tests.support.card_rays import lens_card_rays, pixel_rays
from tests.support.synthetic import FLAT, MINI
from tests.support.told import refuses

ARRAY = CameraArray.for_display(MINI, width=3.0)


def layout_of(display: DisplayProfile = MINI, scale: int = 1, **options) -> RayLayout:
    return RayLayout.for_display(display, CameraArray.for_display(display, width=3.0), scale, **options)


def hits(origin: np.ndarray, direction: np.ndarray, depth: float = ARRAY.distance) -> np.ndarray:
    """Where rays cross the plane z = depth, (..., 2)."""
    return (origin + direction * ((depth - origin[..., 2:]) / direction[..., 2:]))[..., :2]


def views_of(pixels: np.ndarray, views: tuple[int, int]) -> np.ndarray:
    """(H, W, C) -> (sy, sx, py, px, C), independent of lfsr_core.optics.rays."""
    height, width, channels = pixels.shape
    return pixels.reshape(height // views[1], views[1], width // views[0], views[0], channels).swapaxes(1, 2)


def test_the_array_keeps_the_displays_proportions_and_the_layout_is_point_symmetric():
    assert ARRAY.half_height / ARRAY.half_width == pytest.approx(96 / 128)
    assert ARRAY.distance == pytest.approx(3.0 * 180 / 128)
    assert ARRAY.spacing / ARRAY.distance == pytest.approx(MINI.camera_spacing_mm / 180)
    near = CameraArray.for_display(MINI, width=3.0, distance=1.0)
    assert near.distance == 1.0 and near.spacing == pytest.approx(ARRAY.spacing / ARRAY.distance)
    origin, direction = pixel_rays(layout_of())
    np.testing.assert_allclose(origin[::-1, ::-1, :2], -origin[..., :2], atol=1e-12)
    np.testing.assert_allclose(direction[::-1, ::-1, :2], -direction[..., :2], atol=1e-12)
    origin = views_of(pixel_rays(layout_of())[0], (8, 8))
    assert (np.diff(origin[..., 0], axis=3) > 0).all() and (np.diff(origin[..., 1], axis=2) < 0).all()
    centre = reference_rays.rays(layout_of(), 0.5, 0.5, 0.5, 0.5)[0]
    moved = reference_rays.rays(layout_of(), 0.5, 0.5, 0.75, 0.75)[0]
    assert moved[0] > centre[0] and moved[1] > centre[1]


@given(st.integers(1, 100), st.floats(0.01, 10))
def test_centred_views_are_symmetric_about_the_axis(count, spacing):
    offsets = rays.view_offset(np.arange(count), count, spacing)
    np.testing.assert_allclose(offsets, -offsets[::-1], atol=1e-9 * count)
    np.testing.assert_allclose(np.diff(offsets), spacing)


@given(st.integers(1, 20).map(lambda n: 2 * n), st.integers(2, 8))
def test_paper_convention_shifts_low_against_high_by_half_s_minus_one(low_count, scale):
    high = rays.view_offset(np.arange(low_count * scale), low_count * scale, 1.0, "paper")
    low = rays.view_offset(np.arange(low_count), low_count, float(scale), "paper")
    np.testing.assert_allclose(high.reshape(low_count, scale).mean(axis=1) - low, (scale - 1) / 2, atol=1e-9)
    assert rays.view_offset(low_count, 2 * low_count + 1, 1.0, "paper") == 0, "the middle of an odd number"


def test_pixels_of_a_lens_meet_at_its_centre_or_their_place_on_it():
    for x, y in ((0.5, 0.5), (0.25, 0.75)):
        points = views_of(hits(*pixel_rays(layout_of(), (x, y))), (8, 8))
        lens_x = ((np.arange(16) + x) / 16 * 2 - 1) * ARRAY.half_width
        lens_y = -((np.arange(12) + y) / 12 * 2 - 1) * ARRAY.half_height
        expected = np.stack(np.meshgrid(lens_x, lens_y), -1)[:, :, None, None]
        np.testing.assert_allclose(points, np.broadcast_to(expected, (12, 16, 8, 8, 2)), atol=1e-9)
    points = hits(*pixel_rays(layout_of(convention="paper"), place=(0.0, 0.0)))
    expected = (np.arange(128) / 128 * 2 - 1) * ARRAY.half_width  # Eq. (8)
    np.testing.assert_allclose(points[..., 0], np.broadcast_to(expected, (96, 128)), atol=1e-9)


@pytest.mark.parametrize("axis", [0, 1])
def test_where_views_differ_along_one_axis_rays_start_on_it(axis):
    views = [[8, 1], [1, 6]][axis]
    profile = DisplayProfile.from_dict(MINI.to_dict() | {"views": views, "lenses": [128 // views[0], 96 // views[1]]})
    numbers = np.linspace(0, 1, 64, endpoint=False)
    for scale in (1, 2):
        flat = RayLayout.for_display(profile, ARRAY, scale)
        origin, _ = reference_rays.rays(flat, numbers, numbers[::-1], numbers, 1 - numbers)
        assert not origin[:, 1 - axis].any(), "no parallax and no aperture across"
        assert np.ptp(origin[:, axis]) > flat.spacing / 2
        assert flat.cell[axis] == ARRAY.spacing and flat.cell[1 - axis] == 0


def test_lens_list_places_the_same_rays_in_tiles():
    chosen = ((11, 3), (0, 15), (5, 5), (5, 6), (7, 0))
    listed = layout_of(lens_list=chosen)
    assert listed.tiles == (2, 3) and listed.size == (16, 24)
    for whole, tiles in zip(pixel_rays(layout_of()), pixel_rays(listed), strict=True):
        whole, tiles = views_of(whole, (8, 8)), views_of(tiles, (8, 8)).reshape(6, 8, 8, 3)
        for tile, (row, column) in zip(tiles, chosen, strict=False):
            np.testing.assert_allclose(tile, whole[row, column], atol=1e-12)
        np.testing.assert_array_equal(tiles[5], tiles[4])  # the rest repeats the last lens


@pytest.mark.parametrize(("options", "told"), [({"convention": "centered"}, "convention is 'centered'"),
    ({"view_aperture": 1.5}, "view aperture is 1.5"), ({"lens_list": ()}, "list of lenses is empty"),
    ({"lens_list": ((12, 0),)}, r"lens \(12, 0\) is outside the 12 rows and 16 columns"),
    ({"lens_list": ((0, -1),)}, r"lens \(0, -1\) is outside")])
def test_bad_layout_is_refused(options, told):
    refuses(told, layout_of, **options)


CARD_ARRAY = CameraArray(distance=3.0, half_width=1.2, half_height=0.7, spacing=0.1)


@st.composite
def layouts(draw):
    lenses, views = (tuple(draw(st.integers(1, most)) for _ in range(2)) for most in (6, 5))
    lens = st.tuples(st.integers(0, lenses[1] - 1), st.integers(0, lenses[0] - 1))
    return RayLayout(lenses, views, CARD_ARRAY, draw(st.floats(0.01, 1)), draw(st.sampled_from(("centred", "paper"))),
                     draw(st.floats(0, 1)), draw(st.none() | st.lists(lens, min_size=1, max_size=9).map(tuple)))


def quads_at(card, layout, place):
    """Attributes (H, W, 2), interpolated at ``place`` of every pixel, and where on the card that is."""
    across, down = layout.tiles
    px, py = layout.views
    column, row = np.meshgrid(np.arange(across * px), np.arange(down * py))
    quad, wanted = row // py * across + column // px, np.stack([column % px + place[0], row % py + place[1]], -1)

    def corners_of(values):
        return [values[quad, corner] for corner in (0, 1, 3)]
    upper_left, lower_left, upper_right = corners_of(card.cells)
    right = (wanted - upper_left)[..., :1] / (upper_right - upper_left)[..., :1]
    down = (wanted - upper_left)[..., 1:] / (lower_left - upper_left)[..., 1:]

    def at(values):
        upper_left, lower_left, upper_right = corners_of(values)
        return upper_left + right * (upper_right - upper_left) + down * (lower_left - upper_left)
    return at(card.cells), card.targets[quad], at(card.corners)


@settings(deadline=None, max_examples=60)
@given(layouts(), st.floats(0.01, 0.99), st.floats(0.01, 0.99))
def test_rays_of_the_card_are_those_of_the_layout(layout, right, down):
    card = rays.lens_card(layout)
    cells, targets, _ = quads_at(card, layout, (right, down))
    traced = lens_card_rays(card, cells, targets, CARD_ARRAY.distance)
    for ours, expected in zip(traced, pixel_rays(layout, (right, down)), strict=True):
        assert ours == pytest.approx(expected, abs=1e-9)


@settings(deadline=None, max_examples=30)
@given(layouts())
def test_pixels_lie_where_an_orthographic_camera_sees_them(layout):
    """Square pixels as large as a lens, the upper left one first, the card's centre in the middle."""
    card = rays.lens_card(layout)
    width, height = layout.size
    _, _, places = quads_at(card, layout, (0.5, 0.5))
    right, up = (np.arange(width) + 0.5 - width / 2) * card.pixel, (height / 2 - np.arange(height) - 0.5) * card.pixel
    assert places == pytest.approx(np.stack(np.meshgrid(right, up), -1), abs=1e-9)
    assert card.pixel == pytest.approx(2 * CARD_ARRAY.half_width / layout.lenses[0])
    assert np.ptp(card.corners.reshape(-1, 2), axis=0) == pytest.approx((np.array(layout.size) + 2 * RIM) * card.pixel)


def test_a_cell_is_filled_from_edge_to_edge():
    card = rays.lens_card(RayLayout((2, 2), (4, 4), CARD_ARRAY, 2 * CARD_ARRAY.spacing, view_aperture=0.5))
    corner = np.zeros((1, 2))
    starts = [lens_card_rays(card, corner, corner, CARD_ARRAY.distance, value)[0][0, :2] for value in (0.0, 1.0)]
    assert np.abs(starts[1] - starts[0]) == pytest.approx([CARD_ARRAY.spacing / 2] * 2)
    card = rays.lens_card(RayLayout((2, 2), (4, 4), CARD_ARRAY, 0.4, "paper"))
    assert card.aperture == (0, 0) and not card.place_in_pixel


SIZES = st.tuples(*[st.integers(1, 6)] * 4, st.integers(1, 4))


def image_of(sx: int, sy: int, px: int, py: int, channels: int) -> np.ndarray:
    """An EIA in which every value is different."""
    return np.arange(sy * py * sx * px * channels).reshape(sy * py, sx * px, channels)


@given(SIZES)
def test_elemental_images_without_a_copy_and_views_round_trip(size):
    image = image_of(*size)
    parts = rays.to_elemental_images(image, size[:2])
    assert parts.shape == (size[1], size[0], size[3], size[2], size[4])
    np.testing.assert_array_equal(rays.from_elemental_images(parts), image)
    assert np.shares_memory(parts, image)
    views = rays.to_views(image, size[:2])
    assert views.shape == (size[3], size[2], size[1], size[0], size[4])
    np.testing.assert_array_equal(rays.from_views(views), image)


@given(SIZES)
def test_flip_reverses_inside_each_lens_and_undoes_itself(size):
    image = image_of(*size)
    flipped = rays.flip_order(image, size[:2])
    np.testing.assert_array_equal(rays.to_elemental_images(flipped, size[:2]),
                                  rays.to_elemental_images(image, size[:2])[:, :, ::-1, ::-1])
    np.testing.assert_array_equal(rays.flip_order(flipped, size[:2]), image)


@pytest.mark.parametrize("image", [np.zeros((10, 10)), np.zeros((10, 11, 3)), np.zeros((11, 10, 3))])
def test_image_that_lenses_do_not_divide_is_refused(image):
    refuses(r"image has shape \(1[01], 1[01].*5 rows and 2 columns", rays.views_per_lens, image, (2, 5))


HALF = dataclasses.replace(MINI, name="half", lenses=(8, 6), panel_pixels=(64, 48), panel_mm=(64.0, 48.0))
LAYOUTS = {"centred": {}, "paper": {"convention": "paper"}, "points": {"view_aperture": 0.0}}


def world(right, down):
    """A world with detail, by slope."""
    return np.stack([np.sin(9 * right + 2 * down), np.cos(6 * down), (right > 0.1) * 1.0 + down], -1) + 2


def world_image(layout):
    """What Blender renders: mean light of every pixel."""
    image = WorldImage.of(layout)
    times = 4 if np.prod(image.size) < 10**6 else 1  # a large one has small pixels
    right, down = (((np.arange(times * count) + 0.5) / (times * count) * 2 - 1) * reach
                   for count, reach in zip(image.size, image.reach, strict=True))
    return world(*np.meshgrid(right, down)).reshape(image.size[1], times, image.size[0], times, 3).mean((1, 3))


@pytest.mark.parametrize("display", [HALF, FLAT], ids=["half", "flat"])
@pytest.mark.parametrize("options", LAYOUTS.values(), ids=LAYOUTS)
def test_pixels_see_the_mean_of_their_rays(display, options):
    layout = layout_of(display, **options)
    image, (width, height) = WorldImage.of(layout), layout.size
    drawn, count = 0.0, 50
    for seed in range(count):
        places = np.random.default_rng(seed).random((4, height, width))
        x, y = (np.arange(width) + places[0]) / width, 1 - (np.arange(height)[:, None] + places[1]) / height
        _, direction = reference_rays.rays(layout, x, y, places[2], places[3])
        right, down = direction[..., 0] / direction[..., 2], -direction[..., 1] / direction[..., 2]
        assert np.abs(right).max() < image.reach[0] and np.abs(down).max() < image.reach[1]
        drawn = drawn + world(right, down) / count
    lenses = np.argwhere(np.ones(layout.lenses[::-1], bool))[::5]
    seen = WorldView.of(layout, world_image(layout)).elemental_images(lenses)
    expected = rays.to_elemental_images(drawn, layout.lenses)[tuple(lenses.T)]
    smooth, edge = np.abs(seen - expected)[..., :2], np.abs(seen - expected)[..., 2]
    assert smooth.mean() < 0.02 and smooth.max() < 0.16
    assert edge.mean() < 0.015 and edge.max() < 0.35, "of a step of 1, with the noise of 50 rays"


def test_lenses_in_any_order_or_tiles_see_the_same_small_image():
    layout = layout_of()
    view = WorldView.of(layout, world_image(layout))
    lenses = np.random.default_rng(1).integers(0, layout.lenses[::-1], (20, 2))
    alone = [view.elemental_images(lens[None])[0] for lens in lenses]
    np.testing.assert_array_equal(view.elemental_images(lenses), alone)
    listed = ((3, 5), (0, 15), (11, 0), (4, 4), (7, 2))
    layout = layout_of(scale=2, lens_list=listed)
    shown = layout.shown_lenses.reshape(-1, 2)
    assert [tuple(place) for place in shown[:5]] == list(listed) and (shown[5:] == listed[-1]).all()
    assert (layout_of().shown_lenses.reshape(-1, 2) == np.argwhere(np.ones((12, 16)))).all()
    # An 8K light field sees no more of the world than a small image holds.
    layout = layout_of(load_display("bupt-32in-8k"))
    assert np.prod(WorldImage.of(layout).size) < 1e6
    tiny = dataclasses.replace(layout, array=dataclasses.replace(layout.array, spacing=1e-9), spacing=1e-9)
    assert max(WorldImage.of(tiny).size) <= 4096
