"""The geometry that the parameter sweeps speak of, and their own figures on light fields that are known exactly."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.optics.rays import CameraArray, RayLayout, from_elemental_images, to_elemental_images
from lfsr_lab.experiments.sweeps import metrics
from lfsr_lab.experiments.sweeps.measure import DISPLAY_FILE
from lfsr_lab.experiments.sweeps.metrics import Compared
from lfsr_lab.scenes.sweeps.space import Space, card_centre, card_of_motion, hole, rectangle_path
from tests.support.card_rays import pixel_rays
from tests.support.reference_rays import rays
from tests.support.synthetic import FLAT
from tests.support.told import refuses

DISPLAYS = [load_display(DISPLAY_FILE), load_display("mini"), load_display("small")]
# Rows half as high as columns are wide, as the light field of a lens sheet may have them.
OBLONG = DisplayProfile("oblong", (96, 72), (59.04, 44.28), (8, 12), (12, 6), 500.0, 40.0)


def test_usable_depth_is_the_displays_own_and_the_moving_card_fits_it():
    for display, scale in itertools.product(DISPLAYS, (2, 4)):
        space, pitch = Space.of(display, scale), display.lens_pitch_mm[0]
        assert (space.front * pitch, space.behind * pitch) == pytest.approx(display.depth_range_mm(scale), rel=1e-3)
        assert (space.slope(space.depth(1)), space.slope(space.depth(-1))) == pytest.approx((1, -1))
        assert space.slope(space.depth_of_slope(0.7)) == pytest.approx(0.7)
    space = Space.of(DISPLAYS[0], 4)
    y, half, path = card_of_motion(space, 1, 24)
    centres = np.array([card_centre(space, y, place, path) for place in path])
    assert centres.min(0) + centres.max(0) == pytest.approx([0, 0])
    assert (np.abs(centres).max(0) + half <= np.array(space.lenses) / 2 * space.magnified(y)).all()
    # Downwards in lenses is downwards in the scene.
    first_down = next(index for index, place in enumerate(path) if place[1])
    assert centres[first_down][1] < centres[first_down - 1][1]
    assert math.isclose(abs(centres[1][0] - centres[0][0]), space.magnified(y))


@pytest.mark.parametrize("display", DISPLAYS, ids=lambda display: display.name)
@pytest.mark.parametrize("y", [-3.0, 0.0, 5.0])
def test_footprint_and_window_hold_the_rays_that_are_sent(display, y):
    space, layout = Space.of(display, 4), layout_of(display)
    width = layout.size[0]
    # The outermost rays of the first pixel and of the last one in a row.
    raster, random = np.array([0, 1 - 1e-9, width - 1, width - 1e-9]) / width, np.array([0, 1 - 1e-9, 0, 1 - 1e-9])
    pixel = [meet(layout, raster[:2], random[order], y) for order in ([0, 1], [1, 0])]
    assert max(np.ptp(places) for places in pixel) == pytest.approx(space.footprint(y), rel=1e-6)
    places, numbers = np.meshgrid(np.linspace(0, 1 - 1e-9, 4 * width + 1), (0, 1 - 1e-9))
    farthest = np.abs(meet(layout, places.ravel(), numbers.ravel(), y)).max()
    assert space.window(y)[0] - space.footprint(y) <= farthest <= space.window(y)[0] * (1 + 1e-6)


@pytest.mark.parametrize("display", [*DISPLAYS, OBLONG, FLAT], ids=lambda display: display.name)
@pytest.mark.parametrize("y", [0.0, 5.0])
def test_the_window_is_as_high_as_what_is_seen(display, y):
    space, layout = Space.of(display, 2), layout_of(display)
    origin, direction = pixel_rays(layout)
    seen = np.abs(origin + direction * ((layout.array.distance + y) / direction[..., 2:]))[..., 1].max()
    height = space.window(y)[1]
    assert height - space.footprint(y, axis=1) <= seen <= height
    assert space.size == pytest.approx((2 * layout.array.half_width, 2 * layout.array.half_height), rel=1e-3)


def layout_of(display):
    return RayLayout.for_display(display, CameraArray.for_display(display, float(display.lenses[0])))


def meet(layout, raster_x, random_x, y):
    """Where rays meet the depth ``y``, rightwards."""
    origin, direction = rays(layout, raster_x, np.full_like(raster_x, 0.5), random_x)
    return origin[:, 0] + direction[:, 0] / direction[:, 2] * (layout.array.distance + y)


def test_holes_gratings_and_what_no_display_shows():
    space = Space.of(DISPLAYS[0], 4)
    y = space.depth(1)
    assert space.nyquist(y) * space.scale * space.spacing * y / space.distance == pytest.approx(0.5)
    for fraction in (1, 0.75, 0.5, 0.25, 0.1, 0.05, 0.02):
        columns, rows = hole((12, 8), fraction)
        assert 1 <= columns <= 12 and 1 <= rows <= 8
        assert columns * rows / 96 == pytest.approx(fraction, abs=0.006)
    space = Space.of(load_display("small"), 4)
    refuses("at the viewer", space.depth, -4)
    refuses("the limit is 2.47", space.depth_of_slope, 4)


@given(st.integers(2, 40), st.integers(1, 3), st.integers(1, 9), st.integers(1, 9))
def test_the_path_takes_equal_steps_along_one_axis_and_stays_in_its_room(frames, step, across, down):
    path = rectangle_path(frames, step, (across, down))
    assert len(path) == frames and path[0] == (0, 0)
    for (x0, y0), (x1, y1) in itertools.pairwise(path):
        assert sorted((abs(x1 - x0), abs(y1 - y0))) == [0, step]
    assert all(0 <= x <= max(across, step) and 0 <= y <= max(down, step) for x, y in path)
    assert set(rectangle_path(5, 0, (3, 3))) == {(0, 0)}


LENSES, VIEWS, SCALE = (8, 6), (12, 12), 4
DISPLAY = DisplayProfile("test", (96, 72), (59.04, 44.28), LENSES, VIEWS, 500.0, 40.0)
SPACE = Space.of(DISPLAY, SCALE)
ALL = np.ones(LENSES[::-1], bool)
EVEN = np.full((72, 96, 3), 0.5)


def places(y, display=DISPLAY):
    """(H, W) x and z where the pixels' rays meet depth ``y``."""
    layout = layout_of(display)
    origin, direction = pixel_rays(layout, (0.5, 0.5))
    at = origin + direction * ((layout.array.distance + y) / direction[..., 2:])
    return at[..., 0], at[..., 1]


def print_at(x, z):
    """A smooth matt print, (..., 3)."""
    return np.stack([0.5 + 0.3 * np.sin(1.3 * x + 0.4 * z), 0.5 + 0.3 * np.cos(1.1 * z), 0.5 + 0.2 * np.sin(x - z)], -1)


def noise(sigma, seed):
    return np.random.default_rng(seed).normal(0, sigma, EVEN.shape)


def ring_of(width):
    inside = np.zeros((*LENSES[::-1], *VIEWS[::-1], 3))
    inside[:, :, width:-width, width:-width] = 1
    return 1 - from_elemental_images(inside)


def test_errors_at_the_borders_are_found_there_and_the_worst_lens_in_the_foreground():
    x = EVEN + 0.1 * ring_of(3)
    measured = metrics.border_and_centre(Compared(x, EVEN, EVEN, LENSES, ALL), 3)
    assert measured["rmse_border"] == pytest.approx(0.1) and measured["rmse_centre"] == 0
    assert measured["border_ratio"] is None and measured["ssim_border"] < 0.99
    centre = metrics.border_and_centre(Compared(EVEN + 0.1 * (1 - ring_of(3)), EVEN, EVEN, LENSES, ALL), 3)
    assert centre["rmse_border"] == 0 and centre["rmse_centre"] == pytest.approx(0.1)
    x, lenses = EVEN.copy(), (8, 72)  # of views along one axis, whose rows have no border
    to_elemental_images(x, lenses)[..., [0, 1, 2, -3, -2, -1], :] += 0.1
    measured = metrics.border_and_centre(Compared(x, EVEN, EVEN, lenses, np.ones((72, 8), bool)), 3)
    assert measured["rmse_border"] == pytest.approx(0.1) and measured["rmse_centre"] == 0
    x = EVEN.copy()
    to_elemental_images(x, LENSES)[2, 5] += 0.1
    to_elemental_images(x, LENSES)[4, 1] += 0.3
    assert metrics.worst_lens(Compared(x, EVEN, EVEN, LENSES, ALL)) == (4, 1)
    mask = ALL.copy()
    mask[4, 1] = False
    assert metrics.worst_lens(Compared(x, EVEN, EVEN, LENSES, mask)) == (2, 5)
    assert metrics.worst_lens(Compared(x, EVEN, EVEN, LENSES, ~ALL)) is None


def test_the_ratio_of_an_even_error_is_one_noise_cancels_and_borders_count_in_the_foreground_only():
    x, a, b = EVEN + 0.05, EVEN + noise(0.05, 1), EVEN + noise(0.05, 2)
    measured = metrics.border_and_centre(Compared(x, a, b, LENSES, ALL), 3)
    assert measured["border_ratio"] == pytest.approx(1, abs=0.06)
    assert measured["rmse_centre"] == pytest.approx(0.05, abs=0.003)
    mask = ALL.copy()
    mask[0] = False
    x = EVEN.copy()
    x[:VIEWS[1]] = 1
    measured = metrics.border_and_centre(Compared(x, EVEN, EVEN, LENSES, mask), 3)
    assert measured["rmse_border"] == measured["rmse_centre"] == 0
    assert set(metrics.border_and_centre(Compared(x, EVEN, EVEN, LENSES, ~ALL), 3).values()) == {None}


def test_neighbouring_views_that_differ_as_they_should_have_no_error_and_detail_of_one_view_has():
    truth = print_at(*places(3.0))
    assert metrics.neighbour_view_error(Compared(truth, truth, truth, LENSES, ALL)) == 0
    # All views brighter alike: nothing changes as the eye moves.
    assert metrics.neighbour_view_error(Compared(truth + 0.1, truth, truth, LENSES, ALL)) == pytest.approx(0, abs=1e-9)
    invented = truth + noise(0.02, 3)
    halves = truth + noise(0.1, 4), truth + noise(0.1, 5)
    expected = 0.02 * np.sqrt(2)  # of the difference of two
    for images, allowed in (((invented, truth, truth), 0.02), ((invented, *halves), 0.1)):
        assert metrics.neighbour_view_error(Compared(*images, LENSES, ALL)) == pytest.approx(expected, rel=allowed)
    assert metrics.neighbour_view_error(Compared(invented, truth, truth, LENSES, ~ALL)) is None


def test_a_matt_board_has_straight_lines_at_its_own_slope_along_whichever_axis_there_is():
    for step in (2, 4, 8):
        board = print_at(*places(SPACE.depth_of_slope(SCALE / step)))
        assert metrics.epi_straightness(board, LENSES, step) == pytest.approx(1, abs=1e-9)
        assert metrics.epi_straightness(board, LENSES, 1 if step > 2 else 4) < 0.97
    board = print_at(*places(SPACE.depth_of_slope(1)))
    noisy = board + noise(0.1, 6)
    variance = 0.01 / (board.reshape(-1, 3).var(0).mean() + 0.01)  # of the noise, over all
    assert metrics.epi_straightness(noisy, LENSES, 4) == pytest.approx(1 - variance, abs=0.01)
    assert metrics.epi_straightness(noisy, LENSES, 4, board + noise(0.1, 7)) == pytest.approx(1, abs=0.02)
    board = print_at(*places(Space.of(OBLONG, SCALE).depth_of_slope(1), OBLONG))
    assert metrics.epi_straightness(board, OBLONG.lenses, 4, axes=(1,)) == pytest.approx(1, abs=1e-9)
    assert metrics.epi_straightness(board, OBLONG.lenses, 4) < 0.97, "rows are crossed in half as many views"
    assert metrics.epi_straightness(EVEN, LENSES, VIEWS[0]) is None
    assert metrics.epi_straightness(EVEN[:, :VIEWS[0]], (1, LENSES[1]), 2) is None


def moving_card(step, frames=6, change=0.0, display=DISPLAY):
    """Frames, path and card pixels of a print that goes round before a grey ground."""
    space = Space.of(display, SCALE)
    y, half, path = card_of_motion(space, step, frames)
    x, z = places(y, display)
    images, cards = [], []
    for place in path:
        cx, cz = card_centre(space, y, place, path)
        on = ((np.abs(x - cx) < half[0]) & (np.abs(z - cz) < half[1]))[..., None]
        images.append(np.where(on, print_at(x - cx, z - cz), 0.2) + change * len(images))
        cards.append(metrics.card_pixels(space, y, (cx, cz), half))
    return images, path, cards


@pytest.mark.parametrize(("display", "step"), [(DISPLAY, 0), (DISPLAY, 1), (DISPLAY, 2), (OBLONG, 1)],
                         ids=lambda value: getattr(value, "name", value))
def test_a_card_that_only_moves_does_not_flicker(display, step):
    images, path, cards = moving_card(step, frames=12, display=display)
    assert any(card.any() for card in cards) and (len({down for _, down in path}) > 1) == (step > 0)
    assert metrics.flicker(images, display.lenses, path, cards) == pytest.approx(0, abs=1e-9)


def test_flicker_is_the_change_from_frame_to_frame_once_the_motion_is_taken_back():
    images, path, cards = moving_card(1, change=0.01)
    assert metrics.flicker(images, LENSES, path, cards) == pytest.approx(0.01)
    images = moving_card(1)[0]
    assert metrics.flicker(images, LENSES, [(0, 0)] * len(path), cards) > 0.05
    noisy = [image + noise(0.02, seed) for seed, image in enumerate(images)]
    assert metrics.flicker(noisy, LENSES, path, cards) == pytest.approx(0.02 * np.sqrt(2), rel=0.03)
    assert metrics.flicker(images, LENSES, path, [card & False for card in cards]) is None, "no card in two frames"


@pytest.mark.parametrize("display", [DISPLAY, OBLONG], ids=lambda display: display.name)
def test_card_pixels_are_those_whose_every_ray_meets_the_card(display):
    space, layout = Space.of(display, SCALE), layout_of(display)
    y, half, path = card_of_motion(space, 1, 4)
    centre = card_centre(space, y, path[1], path)
    card = metrics.card_pixels(space, y, centre, half)
    width, height = layout.size
    columns, rows = np.meshgrid(np.arange(width), np.arange(height))
    met = np.ones((height, width), bool)
    for u, v in itertools.product((1e-6, 1 - 1e-6), repeat=2):
        for raster in ((u, 1 - v), (1 - u, v)):
            origin, direction = rays(layout, (columns + u) / width, 1 - (rows + v) / height, *raster)
            at = origin + direction * ((layout.array.distance + y) / direction[..., 2:])
            met &= (np.abs(at[..., 0] - centre[0]) <= half[0]) & (np.abs(at[..., 1] - centre[1]) <= half[1])
    expected = to_elemental_images(met[..., None], display.lenses)[..., 0]
    assert card.any() and not (card & ~expected).any()
    # No pixel well inside is left out.
    assert (card == expected).mean() > 0.97
