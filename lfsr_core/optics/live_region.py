"""Where a display's panel lies in the region of a window that shows it pixel by pixel."""

from __future__ import annotations

import dataclasses

from lfsr_core.optics.display import DisplayProfile

Pair = tuple[int, int]


@dataclasses.dataclass(frozen=True)
class LiveRegion:
    """A region of the screen that shows a panel, or its middle; pairs are (horizontal, vertical) counts of pixels."""

    profile: DisplayProfile
    size: Pair  # of the region
    scale: int  # a rendered pixel covers scale × scale of the region's, counted from its lower left corner

    @property
    def drawn(self) -> Pair:
        """The part of the region that whole rendered pixels fill, from its lower left corner."""
        return self.size[0] // self.scale * self.scale, self.size[1] // self.scale * self.scale

    @property
    def corner(self) -> Pair:
        """Lower left corner of the panel, in pixels of the region from its own; below 0 where the panel sticks out.

        A multiple of ``scale``, so that a rendered pixel is one view of one lens.
        """
        left, bottom = ((drawn - pixels) // (2 * self.scale) * self.scale
                        for drawn, pixels in zip(self.drawn, self.profile.panel_pixels, strict=True))
        return left, bottom

    @property
    def shift(self) -> tuple[float, float]:
        """From the region's middle to the panel's, rightwards and upwards, in pixels."""
        across, up = (self.corner[axis] + (self.profile.panel_pixels[axis] - self.size[axis]) / 2 for axis in (0, 1))
        return across, up

    @property
    def is_exact(self) -> bool:
        """True if the region is the panel."""
        return self.size == self.profile.panel_pixels

    def sentence(self) -> str | None:
        """What is wrong with the region and what to do, None if nothing is."""
        if self.is_exact:
            return None
        (width, height), (wide, high) = self.size, self.profile.panel_pixels
        found = f"the live window shows {width}×{height} pixels, but display {self.profile.name!r} has {wide}×{high}"
        if self.drawn != self.size:
            return (f"{found}, and its sides are no multiples of the pixel size {self.scale}, so that views mix: make "
                    "the window full screen on the display, or change its size")
        if width >= wide and height >= high:
            return f"{found}: the image is in the middle of a border; make the window full screen on the display"
        return (f"{found}: a centred part is shown; drag the window to the display, make it full screen, and set that "
                "screen's scaling to 100 % and its resolution to the panel's")
