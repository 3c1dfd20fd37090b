"""The regular light field that a panel with a lens sheet can show: about as many values as the panel has."""

from __future__ import annotations

import dataclasses
import math

from lfsr_core.base.errors import LfsrError
from lfsr_core.optics.sheet import Lenticular, Sheet

VIEWS_PER_SUBPIXEL = 2
MULTIPLE = 4  # of views, so that scales 2 and 4 divide them
MAX_PIXELS = 65536  # a side: Blender renders no more
Pair = tuple[int, int]


@dataclasses.dataclass(frozen=True)
class PanelShape:
    """A panel's pixels and size; pairs are (horizontal, vertical)."""

    panel_pixels: tuple[int, int]
    panel_mm: tuple[float, float]

    def __post_init__(self) -> None:
        if min(self.panel_pixels) < 1 or max(self.panel_pixels) > MAX_PIXELS or min(self.panel_mm) <= 0:
            raise LfsrError(f"panel_pixels is {self.panel_pixels} and panel_mm is {self.panel_mm}, but both must be "
                            f"above 0 and pixels at most {MAX_PIXELS} a side")


def proposed_light_field(panel: PanelShape, sheet: Sheet | None) -> tuple[Pair, Pair]:
    """Return lenses and views of a light field that loses nothing on the panel.

    Lenslets: one lens for every lens of the sheet and one view for every pixel behind it.
    Cylinders: one column for every cylinder, one row for two rows of pixels, and two views
    for every subpixel behind a cylinder, because neighbouring rows show views in between
    (docs/reference/displays.md). Views are rounded up to a multiple of 4.
    """
    if sheet is None:
        raise LfsrError("there is no lens sheet to propose a light field for: give lenses and views")
    if isinstance(sheet, Lenticular):
        across = sheet.lenses_across(panel.panel_mm[0])
        views = _up(VIEWS_PER_SUBPIXEL * 3 * panel.panel_pixels[0] / across, MULTIPLE)
        return (_up(across), _up(panel.panel_pixels[1] / VIEWS_PER_SUBPIXEL)), (views, 1)
    pixel, (pitch_x, pitch_y) = panel.panel_mm[0] / panel.panel_pixels[0], sheet.lenses.pitch_mm
    lenses = _up(panel.panel_mm[0] / pitch_x), _up(panel.panel_mm[1] / pitch_y)
    # The cell of a lens in a hexagonal lattice is higher than the distance between rows.
    cell_y = pitch_y * (4 / 3 if sheet.packing == "hexagonal" else 1)
    return lenses, (_up(pitch_x / pixel, MULTIPLE), _up(cell_y / pixel, MULTIPLE))


def _up(value: float, multiple: int = 1) -> int:
    """Round ``value`` up to a multiple, ignoring an excess that is only a rounding error."""
    return max(1, math.ceil(value / multiple - 1e-6)) * multiple
