"""Where a display's panel lies in a window's region that shows it pixel by pixel."""

from __future__ import annotations

import dataclasses

from lfsr_core.optics.display import DisplayProfile

Pair = tuple[int, int]


@dataclasses.dataclass(frozen=True)
class LiveRegion:
    """A region of the screen that shows a panel, or its middle; pairs are (horizontal, vertical) in pixels."""

    profile: DisplayProfile
    size: Pair  # of the region
    scale: int  # a rendered pixel covers scale × scale pixels of the region, from its lower left corner on

    @property
    def drawn(self) -> Pair:
        """Size of the part of the region, from its lower left corner, that whole rendered pixels fill."""
        return self.size[0] // self.scale * self.scale, self.size[1] // self.scale * self.scale

    @property
    def corner(self) -> Pair:
        """Lower left corner of the panel, in pixels from that of the region; below 0 if the panel is larger.

        A multiple of ``scale``, so that each rendered pixel is one view of one lens.
        """
        left, bottom = ((drawn - pixels) // (2 * self.scale) * self.scale
                        for drawn, pixels in zip(self.drawn, self.profile.panel_pixels, strict=True))
        return left, bottom

    @property
    def shift(self) -> tuple[float, float]:
        """Pixels from the region's centre to the panel's, rightwards and upwards."""
        across, up = (self.corner[axis] + (self.profile.panel_pixels[axis] - self.size[axis]) / 2 for axis in (0, 1))
        return across, up

    def sentence(self) -> str | None:
        """What is wrong with the region and what to do; None if nothing is."""
        (width, height), (wide, high) = self.size, self.profile.panel_pixels
        if (width, height) == (wide, high):
            return None
        found = f"the live window shows {width}×{height} pixels, but display {self.profile.name!r} has {wide}×{high}"
        if self.drawn != self.size:
            return (f"{found}, and its sides are not multiples of the pixel size {self.scale}, so that views mix: make "
                    "the window full screen on the display, or change its size")
        if width >= wide and height >= high:
            return f"{found}: the image is in the middle of a border; make the window full screen on the display"
        return (f"{found}: a centred part is shown; drag the window to the display, make it full screen, and set that "
                "screen's scaling to 100 % and its resolution to the panel's")
