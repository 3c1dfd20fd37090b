"""The sweeps' own figures, on light fields that are known exactly."""

from __future__ import annotations

import numpy as np
import pytest

from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.eia import from_elemental_images, to_elemental_images, to_views
from lfsr_core.optics.rays import CameraArray, RayLayout, rays
from lfsr_lab.experiments.sweeps import metrics
from lfsr_lab.experiments.sweeps.metrics import Compared
from lfsr_lab.scenes.sweeps.space import Space, card_centre, card_of_motion
from tests.support.rays import pixel_rays

LENSES, VIEWS, SCALE = (8, 6), (12, 12), 4
DISPLAY = DisplayProfile("test", (96, 72), (59.04, 44.28), LENSES, VIEWS, 500.0, 40.0)
# Rows half as high as columns are wide, as the light field of a lens sheet may have them.
OBLONG = DisplayProfile("oblong", (96, 72), (59.04, 44.28), (8, 12), (12, 6), 500.0, 40.0)
SPACE = Space.of(DISPLAY, SCALE)
ALL = np.ones(LENSES[::-1], bool)
EVEN = np.full((72, 96, 3), 0.5)


def layout_of(display):
    return RayLayout.for_display(display, CameraArray.for_display(display, float(display.lenses[0])))


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


def test_an_error_at_the_borders_is_found_there_and_nowhere_else():
    x = EVEN + 0.1 * ring_of(3)
    found = metrics.border_and_centre(Compared(x, EVEN, EVEN, LENSES, ALL), 3)
    assert found["rmse_border"] == pytest.approx(0.1) and found["rmse_centre"] == 0
    assert found["border_ratio"] is None and found["ssim_border"] < 0.99
    centre = metrics.border_and_centre(Compared(EVEN + 0.1 * (1 - ring_of(3)), EVEN, EVEN, LENSES, ALL), 3)
    assert centre["rmse_border"] == 0 and centre["rmse_centre"] == pytest.approx(0.1)


def test_where_views_differ_along_one_axis_rows_have_no_border():
    lenses = (8, 72)
    x = EVEN.copy()
    to_elemental_images(x, lenses)[..., [0, 1, 2, -3, -2, -1], :] += 0.1
    found = metrics.border_and_centre(Compared(x, EVEN, EVEN, lenses, np.ones((72, 8), bool)), 3)
    assert found["rmse_border"] == pytest.approx(0.1) and found["rmse_centre"] == 0


def test_the_ratio_of_an_even_error_is_one_and_the_references_noise_cancels():
    x, a, b = EVEN + 0.05, EVEN + noise(0.05, 1), EVEN + noise(0.05, 2)
    found = metrics.border_and_centre(Compared(x, a, b, LENSES, ALL), 3)
    assert found["border_ratio"] == pytest.approx(1, abs=0.06)
    assert found["rmse_centre"] == pytest.approx(0.05, abs=0.003)


def test_borders_count_in_the_foreground_only():
    mask = ALL.copy()
    mask[0] = False
    x = EVEN.copy()
    x[:VIEWS[1]] = 1
    found = metrics.border_and_centre(Compared(x, EVEN, EVEN, LENSES, mask), 3)
    assert found["rmse_border"] == found["rmse_centre"] == 0
    nothing = metrics.border_and_centre(Compared(x, EVEN, EVEN, LENSES, ~ALL), 3)
    assert set(nothing.values()) == {None}


def test_neighbouring_views_that_differ_as_they_should_have_no_error():
    known = print_at(*places(3.0))
    assert metrics.neighbour_view_error(Compared(known, known, known, LENSES, ALL)) == 0
    # All views brighter alike: nothing changes as the eye moves.
    assert metrics.neighbour_view_error(Compared(known + 0.1, known, known, LENSES, ALL)) == pytest.approx(0, abs=1e-9)


def test_detail_invented_in_every_view_alone_is_an_error():
    known = print_at(*places(3.0))
    invented = known + noise(0.02, 3)
    halves = known + noise(0.1, 4), known + noise(0.1, 5)
    expected = 0.02 * np.sqrt(2)  # of the difference of two
    for images, allowed in (((invented, known, known), 0.02), ((invented, *halves), 0.1)):
        error = metrics.neighbour_view_error(Compared(*images, LENSES, ALL))
        assert error == pytest.approx(expected, rel=allowed)
    assert metrics.neighbour_view_error(Compared(invented, known, known, LENSES, ~ALL)) is None


@pytest.mark.parametrize("step", [2, 4, 8])
def test_a_matt_board_has_straight_lines_at_its_own_slope_only(step):
    y = SPACE.depth_of_slope(SCALE / step)
    board = print_at(*places(y))
    assert metrics.epi_straightness(board, LENSES, step) == pytest.approx(1, abs=1e-9)
    assert metrics.epi_straightness(board, LENSES, 1 if step > 2 else 4) < 0.97


def test_noise_bends_the_lines_by_its_share_of_the_variance_and_cancels_between_halves():
    step, y = 4, SPACE.depth_of_slope(1)
    board = print_at(*places(y))
    noisy = board + noise(0.1, 6)
    share = 0.01 / (board.reshape(-1, 3).var(0).mean() + 0.01)
    assert metrics.epi_straightness(noisy, LENSES, step) == pytest.approx(1 - share, abs=0.01)
    assert metrics.epi_straightness(noisy, LENSES, step, board + noise(0.1, 7)) == pytest.approx(1, abs=0.02)


def test_lines_along_one_axis_say_the_same_where_the_other_has_none():
    y = Space.of(OBLONG, SCALE).depth_of_slope(1)
    board = print_at(*places(y, OBLONG))
    assert metrics.epi_straightness(board, OBLONG.lenses, 4, axes=(1,)) == pytest.approx(1, abs=1e-9)
    assert metrics.epi_straightness(board, OBLONG.lenses, 4) < 0.97, "rows are crossed in half as many views"


def test_lines_that_do_not_fit_cannot_be_told():
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


def test_without_its_motion_taken_back_it_would():
    images, path, cards = moving_card(1)
    assert metrics.flicker(images, LENSES, [(0, 0)] * len(path), cards) > 0.05


def test_flicker_is_the_change_from_frame_to_frame():
    images, path, cards = moving_card(1, change=0.01)
    assert metrics.flicker(images, LENSES, path, cards) == pytest.approx(0.01)
    noisy = [image + noise(0.02, seed) for seed, image in enumerate(moving_card(1)[0])]
    assert metrics.flicker(noisy, LENSES, path, cards) == pytest.approx(0.02 * np.sqrt(2), rel=0.03)


def test_no_card_in_two_frames_in_a_row_has_no_flicker():
    images, path, cards = moving_card(0)
    assert metrics.flicker(images, LENSES, path, [card & False for card in cards]) is None


@pytest.mark.parametrize("display", [DISPLAY, OBLONG], ids=lambda display: display.name)
def test_card_pixels_are_those_whose_every_ray_meets_the_card(display):
    space, layout = Space.of(display, SCALE), layout_of(display)
    y, half, path = card_of_motion(space, 1, 4)
    centre = card_centre(space, y, path[1], path)
    card = metrics.card_pixels(space, y, centre, half)
    width, height = layout.size
    columns, rows = np.meshgrid(np.arange(width), np.arange(height))
    met = np.ones((height, width), bool)
    for u in (1e-6, 1 - 1e-6):
        for v in (1e-6, 1 - 1e-6):
            origin, direction = rays(layout, (columns + u) / width, 1 - (rows + v) / height, u, 1 - v)
            at = origin + direction * ((layout.array.distance + y) / direction[..., 2:])
            met &= (np.abs(at[..., 0] - centre[0]) <= half[0]) & (np.abs(at[..., 1] - centre[1]) <= half[1])
            origin, direction = rays(layout, (columns + u) / width, 1 - (rows + v) / height, 1 - u, v)
            at = origin + direction * ((layout.array.distance + y) / direction[..., 2:])
            met &= (np.abs(at[..., 0] - centre[0]) <= half[0]) & (np.abs(at[..., 1] - centre[1]) <= half[1])
    expected = to_elemental_images(met[..., None], display.lenses)[..., 0]
    assert card.any() and not (card & ~expected).any()
    # No pixel well inside is left out.
    assert (card == expected).mean() > 0.97


def test_the_worst_lens_is_found_inside_the_foreground():
    x = EVEN.copy()
    to_elemental_images(x, LENSES)[2, 5] += 0.1
    to_elemental_images(x, LENSES)[4, 1] += 0.3
    assert metrics.worst_lens(Compared(x, EVEN, EVEN, LENSES, ALL)) == (4, 1)
    mask = ALL.copy()
    mask[4, 1] = False
    assert metrics.worst_lens(Compared(x, EVEN, EVEN, LENSES, mask)) == (2, 5)
    assert metrics.worst_lens(Compared(x, EVEN, EVEN, LENSES, ~ALL)) is None


def test_views_are_what_the_figures_think_they_are():
    """A point behind the display moves rightwards from view to view, as the lines of epi_straightness do."""
    x, z = places(SPACE.depth_of_slope(1))
    views = to_views(np.stack([x, z], -1), LENSES)
    assert views[0, 4, 0, 1] == pytest.approx(views[0, 0, 0, 0])
    assert views[4, 0, 1, 0] == pytest.approx(views[0, 0, 0, 0])
