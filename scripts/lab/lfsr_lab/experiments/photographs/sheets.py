"""Random lens sheets and random photographs of them, good and bad ones."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.sheet import Lattice, Lenslet, Lenticular
from lfsr_lab.experiments.photographs.camera import Shot

PANEL = {"format": 2, "name": "sheet", "panel_pixels": [2560, 1440], "panel_mm": [344.0, 193.5],
         "viewing_distance_mm": 500.0, "viewing_angle_deg": 40.0}
# What must be refused, as changes of an ordinary photograph.
BAD: dict[str, dict[str, Any]] = {
    "overexposed": {"exposure": 3.0}, "too dark": {"exposure": 0.004}, "blurred": {"blur": 14.0},
    "far away": {"fill": 0.1}, "cut off": {"aim": (0.35, 0.0)}, "covered": {"cover": (0.3, 0.2, 0.15)},
    "grey": {}, "other pattern": {}, "cropped": {"bend": (0.05, 0.01)}, "another place": {}}
SIZE = (2400, 1800)  # a third of a telephone's pixels, for the sake of time


def nominal(random: np.random.Generator, cylinders: bool) -> DisplayProfile:
    """A profile as a maker would state it: at least 150 lenses along the shorter side, or across."""
    if cylinders:
        slant = random.choice([-1, 1]) * random.uniform(0.05, 0.25)
        sheet: dict[str, Any] = {"lenticular": {"pitch_mm": random.uniform(0.9, 1.6), "slant": slant, "center": 0.3}}
    else:
        pitch, packing = random.uniform(1.0, 1.25), str(random.choice(["square", "hexagonal"]))
        up = pitch * (math.sqrt(0.75) if packing == "hexagonal" else 1)
        sheet = {"lenslet": {"packing": packing, "lenses": {"pitch_mm": [pitch, up]}, "gap_mm": 1.4 * pitch}}
    return DisplayProfile.from_dict(PANEL | sheet)


def unit(random: np.random.Generator, profile: DisplayProfile) -> DisplayProfile:
    """The sheet of one display of that make: other pitch, tilt and centre."""
    sheet = profile.sheet
    if isinstance(sheet, Lenticular):
        return dataclasses.replace(profile, lenticular=dataclasses.replace(
            sheet, pitch_mm=sheet.pitch_mm * (1 + random.uniform(-0.01, 0.01)),
            slant=sheet.slant + random.uniform(-0.004, 0.004), center=random.uniform()))
    across, up = np.array(sheet.lenses.pitch_mm) * (1 + random.uniform(-0.01, 0.01, 2))
    shift = tuple(random.uniform(-0.4, 0.4, 2))
    lenses = Lattice((across, up), random.uniform(-0.3, 0.3), random.uniform(-0.003, 0.003), shift)
    return dataclasses.replace(profile, lenslet=dataclasses.replace(sheet, lenses=lenses))


def shot(random: np.random.Generator, seed: int) -> Shot:
    """A photograph as people take it."""
    within = random.uniform
    return Shot(
        (within(-80, 80), within(-60, 60), within(430, 700)), SIZE, rays=1, fill=within(0.7, 0.92),
        roll_deg=within(-10, 10), aim=(within(-0.03, 0.03), within(-0.03, 0.03)),
        orientation=int(random.integers(1, 9)), flagged=bool(random.integers(2)),
        bend=(within(-0.06, 0.06), within(-0.01, 0.01)),
        off_axis=(within(-0.01, 0.01), within(-0.01, 0.01)), blur=within(0.4, 2.0),
        vignette=within(0, 0.5), exposure=within(0.5, 1.1), ambient=within(0, 0.01), mixing=within(0, 0.08),
        noise=within(0.001, 0.012), quality=int(random.integers(60, 96)), seed=seed)


def wrong(found: DisplayProfile, real: DisplayProfile) -> tuple[float, float, float]:
    """Errors of the pitch as a fraction, of tilt or rotation, and of the phase in the middle, in lens pitches."""
    one, other = found.sheet, real.sheet
    if isinstance(one, Lenticular) and isinstance(other, Lenticular):
        middles = [sheet.lenses_across(real.panel_mm[0]) / 2 * (1 + sheet.slant * real.panel_mm[1] / real.panel_mm[0])
                   - sheet.center for sheet in (one, other)]
        return (one.pitch_mm / other.pitch_mm - 1, one.slant - other.slant, (middles[0] - middles[1] + 0.5) % 1 - 0.5)
    assert isinstance(one, Lenslet) and isinstance(other, Lenslet)
    pitch = np.divide(one.lenses.pitch_mm, other.lenses.pitch_mm) - 1
    waves = np.linalg.inv(other.lenses.matrix(other.packing))
    off = (waves @ np.subtract(one.lenses.shift_mm, other.lenses.shift_mm) + 0.5) % 1 - 0.5
    return (float(pitch[np.abs(pitch).argmax()]), math.radians(one.lenses.rotation_deg - other.lenses.rotation_deg),
            float(off[np.abs(off).argmax()]))
