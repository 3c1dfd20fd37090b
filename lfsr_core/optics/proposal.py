"""The regular light field that a panel with a lens sheet can show: about one value for every one it has."""

from __future__ import annotations

import dataclasses
import math

from lfsr_core.errors import LfsrError
from lfsr_core.optics.sheet import Lenslet, Lenticular

VIEWS_PER_SUBPIXEL = 2
MULTIPLE = 4  # of views, so that scales 2 and 4 divide them
MOST_PIXELS = 65536  # a side: no Blender renders more


@dataclasses.dataclass(frozen=True)
class PanelShape:
    """A panel's pixels and size; pairs are (horizontal, vertical)."""

    panel_pixels: tuple[int, int]
    panel_mm: tuple[float, float]

    def __post_init__(self) -> None:
        if min(self.panel_pixels) < 1 or max(self.panel_pixels) > MOST_PIXELS or min(self.panel_mm) <= 0:
            raise LfsrError(f"panel_pixels is {self.panel_pixels} and panel_mm is {self.panel_mm}, but both must be "
                            f"above 0 and pixels at most {MOST_PIXELS} a side")


def proposed_light_field(panel: PanelShape, lenslet: Lenslet | None,
                         lenticular: Lenticular | None) -> tuple[tuple[int, int], tuple[int, int]]:
    """Lenses and views of a light field that loses nothing against the panel.

    Lenslets: a lens for every lens of the sheet and a view for every pixel behind it.
    Lenticular: a column for every cylinder, a row for two rows of pixels, two views for
    every subpixel behind a cylinder, since those of neighbouring rows lie between one
    another: better than all rows and one view for each (docs/reference/displays.md).
    Views are rounded up. Fewer of either is the artist's choice.
    """
    if lenticular is not None:
        across = lenticular.lenses_across(panel.panel_mm[0])
        views = _up(VIEWS_PER_SUBPIXEL * 3 * panel.panel_pixels[0] / across, MULTIPLE)
        return (_up(across), _up(panel.panel_pixels[1] / VIEWS_PER_SUBPIXEL)), (views, 1)
    if lenslet is None:
        raise LfsrError("there is no lens sheet to propose a light field for: give lenses and views")
    pixel = panel.panel_mm[0] / panel.panel_pixels[0]
    pitch = lenslet.lenses.pitch_mm
    # The cell of a lens in a hexagonal lattice is higher than its rows lie apart.
    cell = (pitch[0], pitch[1] * (4 / 3 if lenslet.packing == "hexagonal" else 1))
    lenses = tuple(_up(size / step) for size, step in zip(panel.panel_mm, pitch, strict=True))
    views = tuple(_up(side / pixel, MULTIPLE) for side in cell)
    return (lenses[0], lenses[1]), (views[0], views[1])


def _up(value: float, multiple: int = 1) -> int:
    """``value`` rounded up to a multiple, but not for what is above one by rounding errors only."""
    return max(1, math.ceil(value / multiple - 1e-6)) * multiple
