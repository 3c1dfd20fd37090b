"""Profiles of CubeVi C1 displays, from the three numbers that its programs show for each unit.

For the pixel in column i and row j from the top, both from 1, and channel c = 0, 1, 2, CubeVi's shaders state
fract((3·(i + j·slope) + c + x0) / interval), in subpixels: 0 at the left border of a cylinder, 1 at its right one,
which is seen from the left.
"""

from __future__ import annotations

import math

from lfsr_core.calibration.visual_json import DISTANCE_BY_HEIGHT
from lfsr_core.optics.display import DisplayProfile, PanelShape, proposed_light_field
from lfsr_core.optics.sheet import MAX_SLANT, Lenticular, Subpixels, check_within

PIXELS, PIXEL_MM = (1440, 2560), 0.0493  # of a panel of 5.7 inches
VIEWS, CONE = 40, 40.0
LEAST_INTERVAL, MOST_INTERVAL = 6.0, 200.0  # subpixels
MOST_SHIFT = 1e4


def profile_of_c1(slope: float, interval: float, x0: float, name: str = "cubevi-c1") -> DisplayProfile:
    """Return the profile of a C1 whose programs show these numbers; LfsrError for impossible ones."""
    check_within("slope (obliquity)", slope, -MAX_SLANT, MAX_SLANT)
    check_within("interval (lineNumber)", interval, LEAST_INTERVAL, MOST_INTERVAL)
    check_within("x0 (deviation)", x0, -MOST_SHIFT, MOST_SHIFT)
    panel_mm = PIXELS[0] * PIXEL_MM, PIXELS[1] * PIXEL_MM
    # Our stripes begin a third of a pixel earlier, pixels are counted from 0 and rows from the bottom.
    center = -(x0 + 2.5 + 3 * (PIXELS[1] + 0.5) * slope) / interval
    sheet = Lenticular(interval / 3 * PIXEL_MM * math.cos(math.atan(slope)), -slope, center % 1)
    lenses, _ = proposed_light_field(PanelShape(PIXELS, panel_mm), sheet)
    return DisplayProfile(
        name, PIXELS, panel_mm, lenses, (VIEWS, 1), DISTANCE_BY_HEIGHT * panel_mm[1], CONE, ei_order="direct",
        description=f"CubeVi C1 of slope {slope:g}, interval {interval:g}, x0 {x0:g}.", subpixels=Subpixels("rgb"),
        lenticular=sheet)
