"""Profiles of format 2: what they state, propose and refuse."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.records import from_data, to_data
from lfsr_core.frames.frame import Frame
from lfsr_core.optics.display import CELL_RULES, PACKINGS, DisplayProfile, Lattice, cell_of
from lfsr_core.optics.panel.subpixel_rays import lattice_point, nearest_point
from tests.support.panels import CELLS, SHEETS, hexagonal, lenticular, profile
from tests.support.synthetic import frame_of
from tests.support.told import refuses


@pytest.mark.parametrize("sheet", SHEETS)
def test_a_profile_and_its_frame_are_read_back(sheet):
    display = SHEETS[sheet]()
    assert DisplayProfile.from_dict(json.loads(json.dumps(display.to_dict()))) == display
    frame = frame_of(1, display)
    assert from_data(Frame, json.loads(json.dumps(to_data(frame))), "frame.json") == frame


def test_a_light_field_is_proposed_and_may_be_smaller():
    display = lenticular()
    across = display.lenticular.lenses_across(120.0)
    assert display.lenses == (math.ceil(across), 80)
    assert display.views == (4 * math.ceil(2 * 3 * 240 / across / 4), 1)
    assert (hexagonal().lenses, hexagonal().views) == ((24, 19), (12, 12))
    assert lenticular(lenses=[20, 16], views=[6, 1]).eia_pixels == (120, 16)


def test_rotating_shearing_and_packing_a_lattice():
    plain = Lattice((2.0, 3.0)).matrix("square")
    np.testing.assert_allclose(plain, [[2, 0], [0, 3]])
    np.testing.assert_allclose(Lattice((2.0, 3.0), 90.0).matrix("square"), [[0, -3], [2, 0]], atol=1e-12)
    np.testing.assert_allclose(Lattice((2.0, 3.0)).matrix("hexagonal"), [[2, 1], [0, 3]])
    np.testing.assert_allclose(Lattice((2.0, 3.0), shear=0.5).matrix("square"), [[2, 1.5], [0, 3]])


@given(st.tuples(st.floats(1, 8), st.floats(1, 8)), st.floats(-90, 90), st.floats(-1, 1), st.sampled_from(PACKINGS))
def test_no_point_of_a_lattice_is_nearer_than_the_nearest(pitch, rotation, shear, packing):
    lattice, inside = Lattice(pitch, rotation, shear), np.linspace(-1, 1, 12)
    places = np.stack(lattice_point(lattice, packing, inside[:, None], inside)).reshape(2, -1)
    found = nearest_point(lattice, packing, *places)
    np.testing.assert_array_equal(found, np.rint(found))
    every = np.stack(lattice_point(lattice, packing, np.arange(-24, 25)[:, None], np.arange(-24, 25)))
    nearest = np.hypot(*(every.reshape(2, -1, 1) - places[:, None])).min(0)
    assert np.hypot(*(lattice_point(lattice, packing, *found) - places)) == pytest.approx(nearest, abs=1e-9)


@pytest.mark.parametrize("rule", CELL_RULES)
def test_cells_repeat_every_four_pixels(rule):
    cells = cell_of(rule, np.arange(8)[:, None], np.arange(8)[None])
    assert cells.shape == (8, 8)
    np.testing.assert_array_equal(cells[:4, :4], cells[4:, 4:])


CYLINDERS, HEX = lenticular().to_dict(), hexagonal().to_dict()


@pytest.mark.parametrize(("data", "told"), [
    ({"format": 3}, "format is 3"),
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
