"""CubeVi C1: its shader's formula, subpixel by subpixel, and the numbers that are typed in."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfsr_core.calibration.makers import profile_of_c1
from lfsr_core.optics.display import load_display
from lfsr_core.optics.panel.subpixel_rays import subpixel_rays
from tests.support.told import refuses

TYPICAL = (0.1057, 19.625, 8.89)


def off_the_formula(profile, slope, interval, x0):
    """Greatest distance of our views from the shader's, as a fraction of all views; 0 and 1 are one border."""
    random, worst = np.random.default_rng(0), 0.0
    for channel in range(3):
        row, column = (random.integers(0, size, 3000) for size in profile.panel_pixels[::-1])
        x1 = ((column + 1) + (row + 1) * slope) * 3 + channel
        from_right = np.mod(x1 + x0, interval) / interval  # its right end is seen from the left
        ours = (subpixel_rays(profile, channel, row, column).view_x + 0.5) / profile.views[0]
        off = np.abs(ours - (1 - from_right))
        worst = max(worst, float(np.minimum(off, 1 - off).max()))
    return worst


@settings(max_examples=20)
@given(st.floats(-0.5, 0.5), st.floats(10, 40), st.floats(-50, 50))
def test_the_shaders_formula(slope, interval, x0):
    profile = profile_of_c1(slope, interval, x0)
    assert profile.views == (40, 1) and off_the_formula(profile, slope, interval, x0) < 1e-9


def test_the_built_in_profile_has_typical_numbers():
    profile = load_display("cubevi-c1")
    assert off_the_formula(profile, *TYPICAL) < 1e-3
    typed = profile_of_c1(*TYPICAL)
    assert (profile.lenses, profile.panel_mm) == (typed.lenses, pytest.approx(typed.panel_mm))
    for numbers in [(3, 19.6, 8.9), (0.1, 0, 8.9), (0.1, 19.6, float("nan")), (float("inf"), 19, 1)]:
        refuses("must be between", profile_of_c1, *numbers)


def test_the_views_of_a_hologram_printer():
    """Behind each hogel are the 23 views, each in the middle of four, the leftmost at its right end."""
    profile = load_display("litiholo")
    columns = np.arange(46)
    rays = subpixel_rays(profile, 0, np.full(46, 100), columns)
    np.testing.assert_allclose(rays.view_x, [4 * view + 1.5 for view in range(22, -1, -1)] * 2, atol=1e-6)
