"""Every built-in display with a lens sheet: the right view from the right place."""

import dataclasses

import pytest

from lfsr_core.optics.display import builtin_names, load_display
from lfsr_core.optics.panel.trace import view_spread
from tests.support.panels import SHEETS, whole

WOVEN = [name for name in builtin_names() if load_display(name).is_woven]


def subpixels_behind_a_lens(display):
    return 3 * display.panel_pixels[0] / display.lenticular.lenses_across(display.panel_mm[0])


@pytest.mark.parametrize("name", WOVEN)
def test_an_eye_sees_the_view_of_its_place(name):
    display = load_display(name)
    spread = view_spread(display)
    assert spread.own + spread.neighbours + spread.others == pytest.approx(1)
    assert abs(spread.error) < 0.25, "in views, on average over the panel and the viewing zone"
    # With as many views as there are subpixels behind a lens, light strays by no more than a subpixel.
    coarse = dataclasses.replace(display, views=(round(subpixels_behind_a_lens(display) / 2), 1))
    assert view_spread(coarse).own > 0.5
    assert view_spread(coarse).others < 0.1


@pytest.mark.parametrize("sheet", SHEETS)
def test_small_sheets_too(sheet):
    spread = view_spread(SHEETS[sheet]())
    assert abs(spread.error) < 0.25 and spread.others < 0.45


def test_whole_numbers_have_no_crosstalk():
    spread = view_spread(whole("lenslet", subpixels={"stripes": "white"}))
    assert (spread.own, spread.others) == (pytest.approx(1), pytest.approx(0))
