"""The panel card's quad and sums give the rays of reference_rays.py, in single precision too."""

import dataclasses
import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.records import from_data, to_data
from lfsr_core.frames.frame import Frame
from lfsr_core.optics.display import CELL_RULES, PACKINGS, DisplayProfile, Lattice, cell_of
from lfsr_core.optics.panel import subpixel_rays
from lfsr_core.optics.panel.panel_card import PARTS, panel_card
from lfsr_core.optics.panel.subpixel_rays import PanelLayout, lattice_point, nearest_point, panel_image
from lfsr_core.optics.rays import CameraArray
from tests.support.card_rays import panel_card_rays
from tests.support.panels import CELLS, SHEETS, hexagonal, large, lenticular, profile, square
from tests.support.reference_rays import panel_rays
from tests.support.synthetic import frame_of
from tests.support.told import refuses

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
    layout, place = layout_of(DISPLAYS[name]), np.array((0.8, 0.3))
    # Where the panel mirrors its image, the card mirrors the place in the pixel too.
    at, mirrored = ((some(layout.size) + inside) / layout.size
                    for inside in (place, np.where(layout.display.flip, 1 - place, place)))
    expected = panel_rays(layout, *np.moveaxis(mirrored, -1, 0))
    traced = panel_card_rays(panel_card(layout), *np.moveaxis(at, -1, 0), layout.array.distance)
    np.testing.assert_allclose(traced, expected, rtol=0, atol=1e-9, equal_nan=False)


@pytest.mark.parametrize("name", [name for name in DISPLAYS if name != "white"])
def test_a_ray_of_a_whole_pixel_is_that_of_the_subpixel_at_its_place(name):
    layout, place = layout_of(DISPLAYS[name]), np.array((0.8, 0.3))
    card, panel = panel_card(layout, of_subpixels=False), np.array(layout.display.panel_pixels)
    pixel, mirrored = some(panel), np.where(layout.display.flip, 1 - place, place)
    for part in range(PARTS):
        inside = (part + place[0]) / PARTS, place[1]
        traced = panel_card_rays(card, *np.moveaxis((pixel + inside) / panel, -1, 0), layout.array.distance)
        at = (pixel * (PARTS, 1) + (part, 0) + mirrored) / layout.size
        np.testing.assert_allclose(traced, panel_rays(layout, *np.moveaxis(at, -1, 0)), 0, 1e-9, equal_nan=False)


@pytest.mark.parametrize("name", DISPLAYS)
def test_a_subpixels_ray_is_the_one_that_the_weave_looks_for(name):
    layout = layout_of(DISPLAYS[name])
    display, array, (width, height) = layout.display, layout.array, layout.size
    raster = np.meshgrid((np.arange(width) + 0.5) / width, 1 - (np.arange(height) + 0.5) / height)
    origin, direction = panel_rays(layout, *raster)
    target = origin + direction / direction[..., 2:] * array.distance
    x, y, eye = (panel_image(layout, np.repeat(values[..., None], 3, -1))
                 for values in (target[..., 0], target[..., 1], origin[..., 0]))
    rows, columns = np.arange(display.panel_pixels[1])[:, None], np.arange(display.panel_pixels[0])
    for channel in range(3):
        rays = subpixel_rays.subpixel_rays(display, channel, rows, columns)
        np.testing.assert_allclose(x[..., channel] / array.half_width,
                                   (rays.column + 0.5) / display.lenses[0] * 2 - 1, atol=1e-9)
        np.testing.assert_allclose(y[..., channel] / array.half_height,
                                   1 - (rays.row + 0.5) / display.lenses[1] * 2, atol=1e-9)
        np.testing.assert_allclose(eye[..., channel] / array.spacing,
                                   rays.view_x + 0.5 - display.views[0] / 2, atol=1e-9)


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


def test_lattices_subpixels_and_a_proposed_light_field():
    card = panel_card(layout_of(DISPLAYS["lenticular"]))
    assert card.places == pytest.approx(np.array([(0, 160), (0, 0), (240 * PARTS, 0), (240 * PARTS, 160)]), abs=0.02)
    assert (card.table[0, :3, 2] == (0, 1, 2)).all() and card.stretch is None
    assert (panel_card(layout_of(FLIPPED)).table[0, :3, 2] == (2, 1, 0)).all()
    display = lenticular()
    across = display.lenticular.lenses_across(120.0)
    assert display.lenses == (math.ceil(across), 80) and display.views == (4 * math.ceil(2 * 3 * 240 / across / 4), 1)
    assert (hexagonal().lenses, hexagonal().views) == ((24, 19), (12, 12))
    assert lenticular(lenses=[20, 16], views=[6, 1]).eia_pixels == (120, 16)
    np.testing.assert_allclose(Lattice((2.0, 3.0)).matrix("square"), [[2, 0], [0, 3]])
    np.testing.assert_allclose(Lattice((2.0, 3.0), 90.0).matrix("square"), [[0, -3], [2, 0]], atol=1e-12)
    np.testing.assert_allclose(Lattice((2.0, 3.0)).matrix("hexagonal"), [[2, 1], [0, 3]])
    np.testing.assert_allclose(Lattice((2.0, 3.0), shear=0.5).matrix("square"), [[2, 1.5], [0, 3]])


@pytest.mark.parametrize("sheet", SHEETS)
def test_a_profile_and_its_frame_are_read_back(sheet):
    display = SHEETS[sheet]()
    assert DisplayProfile.from_dict(json.loads(json.dumps(display.to_dict()))) == display
    frame = frame_of(1, display)
    assert from_data(Frame, json.loads(json.dumps(to_data(frame))), "frame.json") == frame


@given(st.tuples(st.floats(1, 8), st.floats(1, 8)), st.floats(-90, 90), st.floats(-1, 1), st.sampled_from(PACKINGS))
def test_no_point_of_a_lattice_is_nearer_than_the_nearest(pitch, rotation, shear, packing):
    lattice, inside = Lattice(pitch, rotation, shear), np.linspace(-1, 1, 12)
    places = np.stack(lattice_point(lattice, packing, inside[:, None], inside)).reshape(2, -1)
    point = nearest_point(lattice, packing, *places)
    np.testing.assert_array_equal(point, np.rint(point))
    every = np.stack(lattice_point(lattice, packing, np.arange(-24, 25)[:, None], np.arange(-24, 25)))
    nearest = np.hypot(*(every.reshape(2, -1, 1) - places[:, None])).min(0)
    assert np.hypot(*(lattice_point(lattice, packing, *point) - places)) == pytest.approx(nearest, abs=1e-9)


@pytest.mark.parametrize("rule", CELL_RULES)
def test_cells_repeat_every_four_pixels(rule):
    cells = cell_of(rule, np.arange(8)[:, None], np.arange(8)[None])
    assert cells.shape == (8, 8)
    np.testing.assert_array_equal(cells[:4, :4], cells[4:, 4:])


CYLINDERS, HEX = lenticular().to_dict(), hexagonal().to_dict()


@pytest.mark.parametrize(("data", "told"), [({"format": 3}, "format is 3"),
    ({"format": 1}, "table subpixels needs format = 2|table lenticular needs format = 2"),
    ({"weave": "cubic"}, "weave is 'cubic'"), ({"ei_order": "flipped"}, "ei_order is 'flipped'"),
    ({"views": [8, 2]}, r"views is \[8, 2\].*\[N, 1\]"), ({"lenses": [9000, 80]}, "no more than 65536"),
    ({"lenticular": {"pitch_mm": 2.7, "slope": -7}}, "unknown field 'slope'"),
    ({"lenticular": {"pitch_mm": 0}}, "lenticular.pitch_mm is 0"),
    ({"lenticular": {"pitch_mm": 0.1}}, "pitch_mm is 0.1"),
    ({"lenticular": {"pitch_mm": 2.7, "slant": 9.0}}, "lenticular.slant is 9.0"),
    ({"lenticular": {"pitch_mm": "2.7"}}, "pitch_mm is '2.7'"), ({"lenticular": {}}, "'pitch_mm' is missing"),
    ({"lenslet": HEX["lenslet"]}, "both a table lenslet and a table lenticular"),
    ({"lenticular": None}, "table subpixels but no lens sheet|panel_pixels"),
    ({"subpixels": {"stripes": "gbr"}}, "subpixels.stripes is 'gbr'"),
    ({"subpixels": {"cells": [[0.0] * 5]}}, "subpixels.cells"),
    ({"subpixels": {"cells": [list(CELLS[0])], "cell_rule": "x%2"}}, "cell_rule is 'x%2'"),
    ({"subpixels": {"cell_rule": "x%3"}}, "cell_rule is 'x%3'")])
def test_a_wrong_field_is_named_with_value_and_rule(data, told):
    with pytest.raises(LfsrError, match=told) as caught:
        DisplayProfile.from_dict(CYLINDERS | {"subpixels": {"stripes": "rgb"}} | data, source="x.toml")
    assert str(caught.value).startswith("x.toml: ")


@pytest.mark.parametrize(("data", "told"), [
    ({"packing": "round"}, "lenslet.packing is 'round'"), ({"gap_mm": -1.0}, "lenslet.gap_mm is -1.0"),
    ({"lenses": {"pitch_mm": [5.0]}}, "pitch_mm"), ({"lenses": {"pitch_mm": [218.0, 5.0]}}, "pitch_mm is 218.0"),
    ({"lenses": {"pitch_mm": [5.0, 5.0], "rotation_deg": 200.0}}, "rotation_deg is 200.0")])
def test_a_wrong_lattice_is_named(data, told):
    refuses(told, profile, lenslet=HEX["lenslet"] | data)
