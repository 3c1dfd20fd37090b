"""The pieces of the sweeps's page: crops and curves."""

from __future__ import annotations

import numpy as np
import pytest

from lfsr_lab.experiments.sweeps import page
from lfsr_lab.experiments.sweeps.records import Break, Cell, Repeat, SweepReport


@pytest.mark.parametrize("lens", [(0, 0), (5, 7), (11, 15)])
def test_crops_hold_their_lens_and_stay_inside(lens):
    image = np.zeros((96, 128, 3))
    row, column = lens
    image[row * 8:row * 8 + 8, column * 8:column * 8 + 8] = 1
    crop = page.crop_around(image, (16, 12), lens)
    assert crop.shape == (24, 24, 3) and crop.sum() == 8 * 8 * 3


def test_a_crop_of_flat_elemental_images_is_square_too():
    image = np.zeros((54, 31 * 40, 3))
    image[20] = 1
    assert page.crop_around(image, (31, 54), (20, 3)).shape == (54, 120, 3), "as high as there are rows"
    assert page.crop_around(image[:, :31 * 10], (31, 54), (20, 3)).shape == (30, 30, 3)


def test_a_curve_with_gaps_is_drawn_where_it_is_known(monkeypatch):
    cells = tuple(Cell(value, "scene", 16, "m", {"q": quality}, None)
                  for value, quality in ((1, 0.9), (2, None), (3, 0.7)))
    dial = SweepReport("d", "meaning", "unit", "q", (1, 2, 3), cells, {"m": Break(3, 0.7, "below its start")})
    figures = []
    monkeypatch.setattr(page, "svg", lambda figure: figures.append(figure) or "<svg></svg>")
    page.curves(dial, ["m"])
    ring, line = figures[0].axes[0].lines
    assert line.get_xydata().tolist() == [[0, 0.9], [2, 0.7]] and ring.get_xydata().tolist() == [[2, 0.7]]
    assert dial.break_text("m") == "3 s"
    unknown = SweepReport("d", "meaning", "unit", "other", (1, 2, 3), cells, {"m": None})
    assert page.curves(unknown, ["m"]) is None and unknown.break_text("m") == "?"


def test_tables_show_the_mean_over_seeds_and_where_else_the_break_may_be():
    cells = tuple(Cell(value, "scene", 16, "m", {"q": quality, "p": 1.0}, None)
                  for value, quality in ((1, 0.9), (2, 0.8)))
    repeats = (Repeat(2, "m", (0.8, 0.6, None)),)
    dial = SweepReport("d", "meaning", "unit", "q", (1, 2), cells, {"m": Break(2, 0.7, "below bicubic", 1, 2)}, repeats)
    assert dial.series("m", "q") == [0.9, 0.7] and dial.series("m", "p") == [1, 1]
    assert dial.break_text("m") == "2 b (1 to 2)"
    for found, text in ((Break(2, 0.7, "below bicubic", 2, 2), "2 b"),
                        (Break(2, 0.7, "below its start", 2), "2 s (2 to ?)")):
        assert SweepReport("d", "", "", "q", (1, 2), cells, {"m": found}, repeats).break_text("m") == text
