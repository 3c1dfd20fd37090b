"""Displays cut down to fewer pixels are the same displays."""

from __future__ import annotations

import math

import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_lab.experiments.displays.measure import FEW, FULL_WIDTH, kind, with_few_views


def pitch(profile: DisplayProfile) -> tuple[float, float]:
    return profile.panel_mm[0] / profile.panel_pixels[0], profile.panel_mm[1] / profile.panel_pixels[1]


@pytest.mark.parametrize("name", FULL_WIDTH)
def test_a_smaller_panel_has_the_same_sheet_before_the_same_pixels(name):
    whole, part = kind(name), kind(name, 384)
    assert part.panel_pixels == (384, 216)
    for here, there in zip(pitch(part), pitch(whole), strict=True):
        assert math.isclose(here, there)
    assert (part.lenslet, part.subpixels, part.views) == (whole.lenslet, whole.subpixels, whole.views)
    if name == "lenticular":
        assert (part.lenticular.pitch_mm, part.lenticular.slant) == (whole.lenticular.pitch_mm, whole.lenticular.slant)
    else:
        assert math.isclose(part.panel_mm[0] / part.lenses[0], whole.panel_mm[0] / whole.lenses[0], rel_tol=0.03)
    assert part.viewing_angle_deg == whole.viewing_angle_deg
    assert math.isclose(part.viewing_distance_mm / part.panel_mm[0], whole.viewing_distance_mm / whole.panel_mm[0])


@pytest.mark.parametrize("width", [0, 200, 7680 + 192])
def test_a_width_without_whole_lenses_is_refused(width):
    with pytest.raises(LfsrError, match=f"width is {width}, but"):
        kind("lenticular", width)


@pytest.mark.parametrize("name", FULL_WIDTH)
def test_few_views_keep_the_lenses(name):
    profile = kind(name, 384)
    few = with_few_views(profile)
    assert few.lenses == profile.lenses
    assert few.views == (FEW, 1 if name == "lenticular" else FEW)
