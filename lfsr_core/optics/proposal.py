"""The regular light field that a panel with a lens sheet can show: one value for every subpixel or pixel it has."""

from __future__ import annotations

import dataclasses
import math

from lfsr_core.errors import LfsrError
from lfsr_core.optics.sheet import Lenslet, Lenticular

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

    A lens for every lens of the sheet (lenticular: for every cylinder in every row of
    pixels), and as many views as there are pixels behind it (lenticular: subpixels),
    rounded up. Fewer of either is the artist's choice.
    """
    if lenticular is not None:
        across = lenticular.lenses_across(panel.panel_mm[0])
        return (_up(across), panel.panel_pixels[1]), (_up(3 * panel.panel_pixels[0] / across, MULTIPLE), 1)
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
