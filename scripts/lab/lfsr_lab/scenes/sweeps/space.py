"""Geometry of the parameter sweeps.

Lengths are lens pitches from column to column: the display is as many units wide as it has columns of lenses, its
plane is y = 0, the viewer stands at y = -distance, behind the display is y > 0. The light field of a lens sheet may
have rows of another pitch.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

from lfsr_core.base.messages import LfsrError
from lfsr_core.optics.display import DisplayProfile

SQUARE = 0.01  # by which rows and columns may differ where a profile's rounding is all that does
LEAST_NEAR = 0.08  # nearest distance from the viewer, in viewing distances, that anything may have
CARD = (5, 3)  # lenses that the moving card covers, where the display has room for it
CARD_DEPTH = 0.25  # usable depths behind the display
Pair = tuple[int, int]  # (columns, rows)


@dataclasses.dataclass(frozen=True)
class Space:
    """A display and its camera array in lens pitches."""

    lenses: tuple[int, int]  # horizontal and vertical count
    views: tuple[int, int]  # per lens, horizontal and vertical
    distance: float  # of the viewer from the display plane
    spacing: float  # between neighbouring high-resolution views
    scale: int  # factor between rendered and finished views
    row: float = 1.0  # from row to row of lenses

    @classmethod
    def of(cls, profile: DisplayProfile, scale: int) -> Space:
        """Space of ``profile`` for renders at ``scale``."""
        pitch, height = profile.lens_pitch_mm
        row = height / pitch if abs(height / pitch - 1) > SQUARE else 1.0
        return cls(profile.lenses, profile.views, profile.viewing_distance_mm / pitch,
                   profile.camera_spacing_mm / pitch, scale, row)

    @property
    def lens(self) -> tuple[float, float]:
        """Width and height of a lens."""
        return 1.0, self.row

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the display."""
        return self.lenses[0], self.lenses[1] * self.row

    @property
    def front(self) -> float:
        """Usable depth in front of the display at this scale, as ``DisplayProfile.depth_range_mm``."""
        return self.distance / (self.scale * self.spacing + 1)

    @property
    def behind(self) -> float:
        """Usable depth behind the display at this scale; ten viewing distances where there is no nearer limit."""
        return self.distance / max(self.scale * self.spacing - 1, 0.1)

    def depth(self, usable: float) -> float:
        """y of ``usable`` usable depths, negative in front; LfsrError if that is at the viewer."""
        y = usable * (self.behind if usable > 0 else self.front)
        if y < -(1 - LEAST_NEAR) * self.distance:
            raise LfsrError(f"{-usable:g} usable depths in front of this display lie at the viewer: "
                            "choose a display with smaller lenses, or other sweeps with --sweeps")
        return y

    def depth_of_slope(self, slope: float) -> float:
        """y behind the display where a point moves by ``slope`` lenses per rendered view; LfsrError if nowhere."""
        low = self.scale * self.spacing
        if slope >= low:
            raise LfsrError(f"no depth behind this display has a slope of {slope:g} lens pitches per rendered view, "
                            f"the limit is {low:.3g}: choose a display with smaller lenses, or other sweeps")
        return slope * self.distance / (low - slope)

    def slope(self, y: float) -> float:
        """Lenses by which neighbouring rendered views move a point at depth ``y``."""
        return self.scale * self.spacing * y / (self.distance + y)

    def magnified(self, y: float) -> float:
        """Size at depth ``y`` that covers one lens, seen from the viewing position."""
        return (self.distance + y) / self.distance

    def footprint(self, y: float, axis: int = 0) -> float:
        """What the rays of one high-resolution pixel cover at depth ``y``: lens and cell of views together.

        ``axis``: 0 for its width, 1 for its height.
        """
        return self.lens[axis] * self.magnified(y) + self.spacing * abs(y) / self.distance

    def window(self, y: float) -> tuple[float, float]:
        """Half-width and half-height at depth ``y`` of all that any view sees."""
        reach = self.spacing * abs(y) / self.distance / 2
        (width, height), (across, down) = self.size, self.views
        return width / 2 * self.magnified(y) + reach * across, height / 2 * self.magnified(y) + reach * down

    def nyquist(self, y: float) -> float:
        """Cycles per lens pitch, at depth ``y`` != 0, above which rendered views alias inside an elemental image."""
        return self.distance / (2 * self.scale * self.spacing * abs(y))


def hole(lenses: Pair, fraction: float) -> Pair:
    """Return (columns, rows) of the block that is nearest to ``fraction`` of all lenses, the squarest of those."""
    blocks = [(columns, rows) for columns in range(1, lenses[0] + 1) for rows in range(1, lenses[1] + 1)]
    return min(blocks, key=lambda block: (round(abs(math.prod(block) / math.prod(lenses) - fraction), 9),
                                          abs(math.log(block[0] / block[1] / (lenses[0] / lenses[1])))))


def rectangle_path(frames: int, lenses_per_frame: int, room: Pair) -> list[Pair]:
    """Return (column, row) in whole lenses of each frame: clockwise round a rectangle inside ``room``."""
    if lenses_per_frame == 0:
        return [(0, 0)] * frames
    across, down = (max(1, reach // lenses_per_frame) for reach in room)
    steps = [(1, 0)] * across + [(0, 1)] * down + [(-1, 0)] * across + [(0, -1)] * down
    path = [(0, 0)]
    for frame in range(frames - 1):
        (column, row), (right, below) = path[-1], steps[frame % len(steps)]
        path.append((column + lenses_per_frame * right, row + lenses_per_frame * below))
    return path


def card_of_motion(space: Space, lenses_per_frame: int, frames: int) -> tuple[float, tuple[float, float], list[Pair]]:
    """Return the depth y of the moving card, its half-sizes (x, z), and its place per frame in whole lenses."""
    across, down = (min(card, lenses - 2) for card, lenses in zip(CARD, space.lenses, strict=True))
    room = space.lenses[0] - across - 1, space.lenses[1] - down - 1
    y = space.depth(CARD_DEPTH)
    half = (across / 2 * space.magnified(y), down * space.row / 2 * space.magnified(y))
    return y, half, rectangle_path(frames, lenses_per_frame, room)


def card_centre(space: Space, y: float, place: Pair, path: Sequence[Pair]) -> tuple[float, float]:
    """Return (x, z) of the moving card at depth ``y``, z upwards, at ``place`` of a path that the display centres."""
    middle = [(min(axis) + max(axis)) / 2 for axis in zip(*path, strict=True)]
    x, down = ((at - mean) * lens * space.magnified(y)
               for at, mean, lens in zip(place, middle, space.lens, strict=True))
    return x, -down
