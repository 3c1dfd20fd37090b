"""What the stability suite turns: one dial per kind of difficulty, as data, and the geometry the dials speak of.

Lengths are lens pitches: the display is ``lenses`` units wide, its plane is
y = 0, the viewer stands at y = -distance, behind the display is y > 0.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
from collections.abc import Mapping, Sequence

from lfsr_core.display import DisplayProfile
from lfsr_core.errors import LfsrError

SAMPLES = 16
DROP = 0.05       # how far below its own start a method counts as broken
TOLERANCE = 1e-9  # rounding of the difference of two measured figures
LEAST_NEAR = 0.08  # nearest distance from the viewer, in viewing distances, that anything may have


@dataclasses.dataclass(frozen=True)
class Dial:
    """One difficulty.

    ``values`` go from easy to hard, the first of them the start; ``quick`` is a
    part of them. ``meaning`` and ``unit`` say what a value is. ``judged``: the
    metric, larger is better, that breaks. ``scene``: name of the scene where all
    values share one (then the value is samples per pixel), else each value has its own.
    """

    name: str
    meaning: str
    unit: str
    values: tuple[float, ...]
    quick: tuple[float, ...]
    judged: str = "ssim_eia_fg"
    scene: str | None = None

    def scene_name(self, value: float) -> str:
        """Folder of the scene of one value."""
        return self.scene or f"{self.name}-{label(value)}"

    def samples(self, value: float) -> int:
        """Samples per pixel of the low-resolution render of one value."""
        return int(value) if self.scene else SAMPLES


def label(value: float) -> str:
    """A dial's value as text, also in file names."""
    return f"{value:g}"


DIALS: tuple[Dial, ...] = (
    Dial("samples", "samples per pixel of a scene with every kind of material, half a usable range deep",
         "samples per pixel", (64, 32, 16, 8, 4, 2, 1), (64, 16, 1), scene="samples"),
    Dial("depth-behind", "textured bodies behind the display plane", "usable depths at this scale",
         (0, 0.5, 1, 1.5, 2, 2.5, 3), (0, 1, 3)),
    Dial("depth-front", "the same bodies in front of the display plane", "usable depths at this scale",
         (0, 0.5, 1, 1.5, 2, 2.5, 3), (0, 1, 3)),
    Dial("wire", "thickness of crossing wires, half a usable depth behind the display",
         "high-resolution pixels at the wires' depth", (2, 1, 1 / 2, 1 / 4, 1 / 8, 1 / 16), (2, 1 / 2, 1 / 8)),
    Dial("texture", "frequency of a sine grating at the far usable depth", "Nyquist frequencies of the rendered views",
         (1 / 8, 1 / 4, 1 / 2, 3 / 4, 1, 1.5, 2), (1 / 8, 1, 1.5)),
    Dial("glass-index", "refractive index of smooth glass bodies before a board of tiles", "index of refraction",
         (1.05, 1.15, 1.33, 1.5, 1.8, 2.4), (1.05, 1.5, 2.4)),
    Dial("glass-roughness", "roughness of the same glass, index 1.45", "Cycles roughness",
         (0, 0.05, 0.1, 0.2, 0.4, 0.8), (0, 0.1, 0.8)),
    Dial("mirror", "distance of a mirror image behind the mirror on the display plane", "usable depths at this scale",
         (0.5, 1, 1.5, 2, 2.5, 3), (0.5, 1, 3)),
    Dial("caustics", "angle of the only lamp, whose light reaches the floor through glass and off a metal ring",
         "degrees across", (90, 60, 40, 25, 15, 8), (90, 40, 8)),
    Dial("fireflies", "radius of glowing balls of constant power", "high-resolution pixels at the display plane",
         (1 / 2, 1 / 4, 1 / 8, 1 / 16, 1 / 32, 1 / 64), (1 / 2, 1 / 8, 1 / 64)),
    Dial("share", "share p of lenses that see the foreground through a hole in a card on the display plane",
         "share of lenses", (1, 0.75, 0.5, 0.25, 0.1, 0.05, 0.02), (1, 0.25, 0.02)),
    Dial("hdri", "brightness of the world picture behind the subject; the subject's light stays",
         "times the world that lights it", (0.25, 0.5, 1, 2, 4, 8), (0.25, 1, 8)),
    Dial("border", "contrast of glossy metal tiles, one per lens, whose edges are the lenses' edges; dark ones stay",
         "Michelson contrast", (0, 0.25, 0.5, 0.7, 0.8, 0.9), (0, 0.5, 0.9), judged="ssim_border"),
    Dial("motion", "sideways steps per frame of a printed card that goes round a rectangle",
         "lenses per frame", (0, 1, 2), (0, 1), judged="steadiness"),
    Dial("eye", "slope of a finely printed board: what the eye meets when it moves by one rendered view",
         "lens pitches per rendered view", (1 / 4, 1 / 2, 1, 2, 4), (1 / 4, 1, 4), judged="epi_straightness"),
    Dial("recall", "diameter of single bright specks scattered before and behind the display plane",
         "high-resolution pixels at their depth", (1, 1 / 2, 1 / 4, 1 / 8, 1 / 16, 1 / 32), (1, 1 / 4, 1 / 32),
         judged="recall"),
)
MOTION, EYE = "motion", "eye"
CARD = (5, 3)  # lenses that the moving card covers, where the display has room for it
CARD_DEPTH = 0.25  # usable depths behind the display


def choose_dials(names: Sequence[str] | None) -> tuple[Dial, ...]:
    """Dials of these names in the suite's order, all without names; LfsrError for an unknown name."""
    known = [dial.name for dial in DIALS]
    for name in names or ():
        if name not in known:
            close = difflib.get_close_matches(name, known, n=1, cutoff=0.4)
            hint = f"did you mean {close[0]!r}? " if close else ""
            raise LfsrError(f"there is no dial {name!r}: {hint}Choose from {', '.join(known)}")
    return tuple(dial for dial in DIALS if not names or dial.name in names)


@dataclasses.dataclass(frozen=True)
class Break:
    """Where a method breaks: the dial's ``value``, the judged ``quality`` there, and ``reason``."""

    value: float
    quality: float
    reason: str


def breaking_point(values: Sequence[float], quality: Mapping[float, float | None],
                   bicubic: Mapping[float, float | None] | None = None, drop: float = DROP) -> Break | None:
    """First of ``values``, easy to hard, where ``quality`` is below ``bicubic`` or ``drop`` below its own start.

    The start is the first value with a quality. Values without one are passed
    over. None where the method never breaks. Without ``bicubic`` (for bicubic
    itself) only the second rule counts.
    """
    told = [(value, quality[value]) for value in values if quality.get(value) is not None]
    for value, found in told:
        rival = (bicubic or {}).get(value)
        if rival is not None and found < rival - TOLERANCE:
            return Break(value, found, "below bicubic")
        if found <= told[0][1] - drop + TOLERANCE:
            return Break(value, found, "below its start")
    return None


@dataclasses.dataclass(frozen=True)
class Space:
    """A display and its camera array in lens pitches; ``spacing`` is between high-resolution views."""

    lenses: tuple[int, int]
    views: tuple[int, int]
    distance: float
    spacing: float
    scale: int

    @classmethod
    def of(cls, profile: DisplayProfile, scale: int) -> Space:
        """Space of ``profile`` for renders at ``scale``."""
        pitch = profile.lens_pitch_mm[0]
        return cls(profile.lenses, profile.views, profile.viewing_distance_mm / pitch,
                   profile.camera_spacing_mm / pitch, scale)

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
                            "choose a display with smaller lenses, or other dials with --dials")
        return y

    def depth_of_slope(self, slope: float) -> float:
        """y behind the display where a point moves by ``slope`` lenses per rendered view; LfsrError if nowhere."""
        low = self.scale * self.spacing
        if slope >= low:
            raise LfsrError(f"no depth behind this display has a slope of {slope:g} lens pitches per rendered view, "
                            f"the limit is {low:.3g}: choose a display with smaller lenses, or other dials")
        return slope * self.distance / (low - slope)

    def slope(self, y: float) -> float:
        """Lenses by which neighbouring rendered views move a point at depth ``y``."""
        return self.scale * self.spacing * y / (self.distance + y)

    def magnified(self, y: float) -> float:
        """Size at depth ``y`` that covers one lens, seen from the viewing position."""
        return (self.distance + y) / self.distance

    def footprint(self, y: float) -> float:
        """Width at depth ``y`` that the rays of one high-resolution pixel cover: lens and cell of views together."""
        return self.magnified(y) + self.spacing * abs(y) / self.distance

    def window(self, y: float) -> tuple[float, float]:
        """Half-width and half-height at depth ``y`` of all that any view sees."""
        reach = self.spacing * abs(y) / self.distance / 2
        return tuple(lenses / 2 * self.magnified(y) + reach * views
                     for lenses, views in zip(self.lenses, self.views, strict=True))

    def nyquist(self, y: float) -> float:
        """Cycles per lens pitch, at depth ``y`` != 0, above which rendered views alias inside an elemental image."""
        return self.distance / (2 * self.scale * self.spacing * abs(y))


def hole(lenses: tuple[int, int], share: float) -> tuple[int, int]:
    """(columns, rows) of a block of lenses whose share of all is nearest to ``share``, the squarest of those."""
    blocks = [(columns, rows) for columns in range(1, lenses[0] + 1) for rows in range(1, lenses[1] + 1)]
    return min(blocks, key=lambda block: (round(abs(math.prod(block) / math.prod(lenses) - share), 9),
                                          abs(math.log(block[0] / block[1] / (lenses[0] / lenses[1])))))


def rectangle_path(frames: int, lenses_per_frame: int, room: tuple[int, int]) -> list[tuple[int, int]]:
    """(column, row) in whole lenses of each of ``frames`` frames: clockwise round a rectangle inside ``room``.

    Steps are ``lenses_per_frame`` long; 0 stays at the start.
    """
    if lenses_per_frame == 0:
        return [(0, 0)] * frames
    across, down = (max(1, reach // lenses_per_frame) for reach in room)
    steps = [(1, 0)] * across + [(0, 1)] * down + [(-1, 0)] * across + [(0, -1)] * down
    place, path = (0, 0), []
    for frame in range(frames):
        path.append(place)
        step = steps[frame % len(steps)]
        place = tuple(at + lenses_per_frame * by for at, by in zip(place, step, strict=True))
    return path


def card_of_motion(space: Space, lenses_per_frame: int,
                   frames: int) -> tuple[float, tuple[float, float], list[tuple[int, int]]]:
    """Depth y of the moving card, its half-sizes (x, z), and its place per frame in whole lenses."""
    covered = tuple(min(card, lenses - 2) for card, lenses in zip(CARD, space.lenses, strict=True))
    room = tuple(lenses - card - 1 for lenses, card in zip(space.lenses, covered, strict=True))
    y = space.depth(CARD_DEPTH)
    half = tuple(card / 2 * space.magnified(y) for card in covered)
    return y, half, rectangle_path(frames, lenses_per_frame, room)


def card_centre(space: Space, y: float, place: tuple[int, int], path: Sequence[tuple[int, int]]) -> tuple[float, float]:
    """(x, z) of the card at ``place`` of a path that lies in the middle of the display; z upwards."""
    middle = [(min(axis) + max(axis)) / 2 for axis in zip(*path, strict=True)]
    return (place[0] - middle[0]) * space.magnified(y), -(place[1] - middle[1]) * space.magnified(y)
