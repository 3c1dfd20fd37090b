"""The panel card's quad and sums give the rays of panel_rays.py, in single precision too."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.optics.display import Lattice
from lfsr_core.optics.panel.panel_card import PARTS, Rows, panel_card
from lfsr_core.optics.panel.subpixel_rays import PanelLayout, panel_rays
from lfsr_core.optics.rays import CameraArray
from tests.support.card_rays import nearest, panel_card_rays
from tests.support.panels import SHEETS, large, lenticular, square

FLIPPED = lenticular(subpixels={"stripes": "bgr"})
FLIPPED = dataclasses.replace(FLIPPED, lenticular=dataclasses.replace(FLIPPED.lenticular, flip=(True, True)))
APART = square()  # elemental images that are not those of the lenses seen from the middle
APART = dataclasses.replace(APART, lenslet=dataclasses.replace(
    APART.lenslet, elemental_images=dataclasses.replace(APART.lenslet.lenses.scaled(1.03), rotation_deg=-1.5)))
SHEARED = dataclasses.replace(APART, lenslet=dataclasses.replace(
    APART.lenslet, lenses=Lattice((2.0, 5.0), 20.0, 1.0), elemental_images=None))
DISPLAYS = {**{name: make() for name, make in SHEETS.items()}, "flipped": FLIPPED, "apart": APART, "sheared": SHEARED,
            "flipped cells": dataclasses.replace(SHEETS["cells"](), lenticular=FLIPPED.lenticular),
            "white": lenticular(subpixels={"stripes": "white"})}


def layout_of(display, aperture=1.0):
    return PanelLayout(display, CameraArray.for_display(display, 2.0), aperture)


def some(size, count=5000):
    """Columns and rows, (count, 2), drawn from a grid, with its corners."""
    drawn = np.random.default_rng(0).integers(0, size, (count, 2))
    drawn[:4] = [(x * (size[0] - 1), y * (size[1] - 1)) for x in (0, 1) for y in (0, 1)]
    return drawn


@pytest.mark.parametrize("name", DISPLAYS)
def test_rays_are_those_of_the_layout(name):
    layout = layout_of(DISPLAYS[name])
    corner, place = some(layout.size), np.array((0.8, 0.3))
    found, expected = [], []
    # Where the panel mirrors its image, the card mirrors the place in the pixel too.
    mirrored = np.where(layout.display.flip, 1 - place, place)
    for rays, at, inside in ((found, corner + place, panel_card_rays), (expected, corner + mirrored, panel_rays)):
        right, up = np.moveaxis(at / layout.size, -1, 0)
        rays += inside(panel_card(layout), right, up, layout.array.distance) if inside is panel_card_rays else inside(
            layout, right, up)
    for ours, theirs in zip(found, expected, strict=True):
        assert ours == pytest.approx(theirs, abs=1e-9)


@pytest.mark.parametrize("name", [name for name in DISPLAYS if name != "white"])
def test_a_ray_of_a_whole_pixel_is_that_of_the_subpixel_at_its_place(name):
    layout, place = layout_of(DISPLAYS[name]), np.array((0.8, 0.3))
    card, panel = panel_card(layout, of_subpixels=False), np.array(layout.display.panel_pixels)
    pixel = some(panel)
    mirrored = np.where(layout.display.flip, 1 - place, place)
    for part in range(PARTS):
        inside = (part + place[0]) / PARTS, place[1]
        found = panel_card_rays(card, *np.moveaxis((pixel + inside) / panel, -1, 0), layout.array.distance)
        at = (pixel * (PARTS, 1) + (part, 0) + mirrored) / layout.size
        for ours, theirs in zip(found, panel_rays(layout, *np.moveaxis(at, -1, 0)), strict=True):
            assert ours == pytest.approx(theirs, abs=1e-9)


@pytest.mark.parametrize("name", ["cells", "hexagonal", "square", "sheared"])
def test_random_points_fill_the_lens_as_those_of_the_layout(name):
    """Not number by number: both choose points evenly over the lens, in other orders."""
    layout, random = layout_of(DISPLAYS[name]), np.random.default_rng(0).random((2, 20000))
    place = np.array(0.53)
    ends = [(origin + direction / direction[..., 2:] * layout.array.distance)[..., :2] for origin, direction in (
        panel_card_rays(panel_card(layout), place, place, layout.array.distance, tuple(random)),
        panel_rays(layout, place, place, *random))]
    assert ends[0].mean(0) == pytest.approx(ends[1].mean(0), abs=0.02 * ends[1].std())
    assert np.cov(ends[0].T) == pytest.approx(np.cov(ends[1].T), abs=0.03 * np.var(ends[1]))


@given(st.floats(-0.6, 0.6), st.floats(0.5, 2), st.lists(st.tuples(*[st.floats(-20, 20)] * 2), min_size=1))
def test_nearest_is_the_nearest_point_of_the_lattice(shift, square, counts):
    away = nearest(np.array(counts), Rows(shift, square))
    steps = [(column + shift * row, row) for column in range(-2, 3) for row in range(-2, 3)]
    squares = [(away[:, 0] - right) ** 2 + square * (away[:, 1] - up) ** 2 for right, up in steps]
    assert (away[:, 0] ** 2 + square * away[:, 1] ** 2 <= np.min(squares, 0) + 1e-9).all()
    rows = np.array(counts)[:, 1] - away[:, 1]
    columns = np.array(counts)[:, 0] - away[:, 0] - shift * np.rint(rows)
    assert rows == pytest.approx(np.rint(rows), abs=1e-9) and columns == pytest.approx(np.rint(columns), abs=1e-9)


@pytest.mark.parametrize("cells", [False, True])
def test_in_single_precision_the_phase_is_right_to_a_thousandth_of_a_cylinder(cells):
    """In every 216th row of an 8K panel, its corners included, at random places in the subpixels."""
    layout = layout_of(large(cells))
    card, (width, height), random = panel_card(layout), layout.size, np.random.default_rng(0)
    rows = np.append(np.arange(0, height, 216), height - 1)[:, None]
    across = (np.arange(width) + random.uniform(0.02, 0.98, (len(rows), width))) / width
    up = (rows + random.uniform(0.02, 0.98, rows.shape)) / height
    zone = layout.display.views[0] * layout.array.spacing
    starts = [panel_card_rays(card, across, up, layout.array.distance, None, precision)[0][..., 0].astype(float) / zone
              for precision in (np.float32, np.float64)]
    error = np.abs(starts[0] - starts[1])
    error = np.minimum(error, 1 - error)
    assert error.max() < 1e-3 and error.mean() > 1e-6, "of one cylinder"


def test_subpixels_are_counted_in_thirds_from_the_panels_lower_left_corner():
    card = panel_card(layout_of(DISPLAYS["lenticular"]))
    assert card.places == pytest.approx(np.array([(0, 160), (0, 0), (240 * PARTS, 0), (240 * PARTS, 160)]), abs=0.02)
    assert (card.table[0, :3, 2] == (0, 1, 2)).all() and card.stretch is None
    assert (panel_card(layout_of(FLIPPED)).table[0, :3, 2] == (2, 1, 0)).all()
