"""The parameter sweeps: each makes one thing harder, value by value, until methods break.

A sweep is data here; lfsr_lab.scenes.sweeps builds its scenes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from lfsr_core.base.errors import LfsrError, did_you_mean

SAMPLES = 16


@dataclasses.dataclass(frozen=True)
class Sweep:
    name: str  # as on the command line and in the names of folders
    meaning: str  # what a value is
    unit: str  # of the values
    values: tuple[float, ...]  # from easy to hard, the first of them the start
    quick: tuple[float, ...]  # the part of them that a quick run measures
    judged: str = "ssim_eia_fg"  # the metric, larger is better, that breaks
    # The one scene of all values, which then are samples per pixel; None where each value has its own.
    scene: str | None = None

    def scene_name(self, value: float) -> str:
        return self.scene or f"{self.name}-{label(value)}"

    def samples(self, value: float) -> int:
        """Return the samples per pixel of the low-resolution render of one value."""
        return int(value) if self.scene else SAMPLES


def label(value: float) -> str:
    """Return a value of a sweep as text, also in file names."""
    return f"{value:g}"


SWEEPS: tuple[Sweep, ...] = (
    Sweep("samples", "samples per pixel of a scene with every kind of material, half a usable range deep",
         "samples per pixel", (64, 32, 16, 8, 4, 2, 1), (64, 16, 1), scene="samples"),
    Sweep("depth-behind", "textured bodies behind the display plane", "usable depths at this scale",
         (0, 0.5, 1, 1.5, 2, 2.5, 3), (0, 1, 3)),
    Sweep("depth-range", "the same bodies spread from before the display to behind it", "usable depths to either side",
         (0, 0.5, 1, 1.5, 2, 2.5, 3), (0, 1, 3)),
    Sweep("wire", "thickness of crossing wires, half a usable depth behind the display",
         "high-resolution pixels at the wires' depth", (2, 1, 1 / 2, 1 / 4, 1 / 8, 1 / 16), (2, 1 / 2, 1 / 8)),
    Sweep("texture", "frequency of a sine grating at the far usable depth", "Nyquist frequencies of the rendered views",
         (1 / 8, 1 / 4, 1 / 2, 3 / 4, 1, 1.5, 2), (1 / 8, 1, 1.5)),
    Sweep("glass-texture", "width of the tiles of a board behind smooth glass bodies", "lens pitches",
         (12, 6, 3, 2, 1.5, 1, 0.75), (12, 2, 0.75)),
    Sweep("glass-roughness", "roughness of the same glass before tiles 1.5 lenses wide", "Cycles roughness",
         (0, 0.05, 0.1, 0.2, 0.4, 0.8), (0, 0.1, 0.8)),
    Sweep("mirror", "distance of a mirror image behind the mirror on the display plane", "usable depths at this scale",
         (0.5, 1, 1.5, 2, 2.5, 3), (0.5, 1, 3)),
    Sweep("caustics", "angle of the only lamp, whose light reaches the floor through glass and off a metal ring",
         "degrees across", (90, 60, 40, 25, 15, 8), (90, 40, 8)),
    Sweep("lamps", "radius of glowing balls of constant power beside dark surfaces",
         "high-resolution pixels at the display plane", (1 / 2, 1 / 4, 1 / 8, 1 / 16, 1 / 32, 1 / 64),
         (1 / 2, 1 / 8, 1 / 64)),
    Sweep("glitter", "density of flakes of metal under a small lamp", "flakes per lens",
         (1 / 4, 1, 4, 16, 64, 256), (1 / 4, 4, 256)),
    Sweep("share", "fraction p of lenses that see the foreground through a hole in a card on the display plane",
         "fraction of lenses", (1, 0.75, 0.5, 0.25, 0.1, 0.05, 0.02), (1, 0.25, 0.02)),
    Sweep("background", "brightness of a plain background; the grey subject stays", "times the subject's brightness",
         (0, 1 / 4, 1 / 2, 3 / 4, 7 / 8, 1), (0, 1 / 2, 1)),
    Sweep("border", "contrast of glossy metal tiles, one per lens, whose edges are the lenses' edges; dark ones stay",
         "Michelson contrast", (0, 0.25, 0.5, 0.7, 0.8, 0.9), (0, 0.5, 0.9), judged="ssim_border"),
    Sweep("motion", "sideways steps per frame of a printed card that goes round a rectangle",
         "lenses per frame", (0, 1, 2), (0, 1), judged="steadiness"),
    Sweep("eye", "slope of a finely printed board: what the eye meets when it moves by one rendered view",
         "lens pitches per rendered view", (1 / 4, 1 / 2, 1, 2, 4), (1 / 4, 1, 4), judged="epi_straightness"),
    Sweep("recall", "diameter of single bright specks scattered before and behind the display plane",
         "high-resolution pixels at their depth", (1, 1 / 2, 1 / 4, 1 / 8, 1 / 16, 1 / 32), (1, 1 / 4, 1 / 32),
         judged="recall"),
)
MOTION, EYE = "motion", "eye"


def choose_sweeps(names: Sequence[str] | None) -> tuple[Sweep, ...]:
    """Return the sweeps of these names in the order above, all without names; LfsrError for an unknown name."""
    known = [sweep.name for sweep in SWEEPS]
    for name in names or ():
        if name not in known:
            hint = did_you_mean(name, known, cutoff=0.4)
            raise LfsrError(f"there is no sweep {name!r}: {hint}Choose from {', '.join(known)}")
    return tuple(sweep for sweep in SWEEPS if not names or sweep.name in names)
