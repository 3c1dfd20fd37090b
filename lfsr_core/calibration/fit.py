"""Measure a lens sheet's pitch, rotation and shift from photographs of the phase pattern taken from known places.

Through each lens a camera sees one point of the panel. The pattern's fringes are slightly closer together than
elemental images, so the camera sees one fringe over several lenses (``carriers``). Let k be the waves of the elemental
images on the panel, K those of the lenses, E the camera's place at height z, b = gap/z and m = 1 + 1/carrier. A lens
at c shows the panel's point (1 + b)·c − b·E, so in places on the panel the fringes that are seen have the wave
m·k − K/(1 + b) and, at its centre, the phase K·shift − b·K·E/(1 + b) − m·(phase of k). Both are linear in the unknowns
K and shift.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.calibration.fringes import Fringes, Picture, find_fringes
from lfsr_core.calibration.patterns import FRINGE_CHANNELS, dots, tones
from lfsr_core.calibration.photograph import Raster, View, find_panel, grid
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.subpixel_rays import Geometry, elemental_waves
from lfsr_core.optics.sheet import Lattice, Lenticular

MOST_ACROSS = 2048  # points at which a photograph is sampled
PER_LENS = 3  # pixels of a photograph that are enough for a lens
MAX_DIFFERENCE = 0.05  # between the lenses of several photographs, in lens pitches
PLACE, PLACE_MM = 0.06, 5.0  # from the stated place to that by the perspective: of the distance, and millimetres
PITCH, LENSES, TURN = 1e-5, 2e-3, 1e-4  # most errors: of the pitch, all over the panel in pitches, of the rotation
SURE = 2.2  # standard deviations as estimated; errors of simulated photographs deviated by 0.7 of one
ROUNDS = 3  # until the gap, which follows from the pitch, stays


@dataclasses.dataclass(frozen=True)
class Photograph:
    """A photograph of the phase pattern and where it was taken."""

    image: Array  # (H, W, 3) from 0 to 1
    eye_mm: tuple[float, float, float]  # camera, from the middle of the lenses, y up, z towards the viewer


@dataclasses.dataclass(frozen=True)
class Seen:
    """What one photograph shows."""

    view: View
    lenses: tuple[Fringes, ...]  # waves of the lenses as they lie before the panel; cylinders: one, small lenses: two
    eye_mm: tuple[float, float, float]


@dataclasses.dataclass(frozen=True)
class Errors:
    """Standard deviations of what was measured."""

    pitch: float  # as a fraction of it
    turn: float  # radians
    shift: float  # lens pitches


@dataclasses.dataclass(frozen=True)
class Calibration:
    """A profile with the lens sheet of photographs, and how far to trust it."""

    profile: DisplayProfile
    seen: tuple[Seen, ...]
    errors: Errors
    per_mm: float  # change of the pitch, as a fraction, with a millimetre of the camera's distance


def fit_profile(profile: DisplayProfile, photographs: Sequence[Photograph]) -> Calibration:
    """Return ``profile``, for which the pattern was drawn, with the lens sheet that the photographs show.

    LfsrError if no panel, dots or fringes are found, if photographs disagree, or if the result is too uncertain.
    """
    return combine(profile, [see(profile, photograph) for photograph in photographs])


def see(profile: DisplayProfile, photograph: Photograph) -> Seen:
    """Return the panel and its fringes in one photograph; LfsrError if they are not found."""
    if photograph.eye_mm[2] <= 0:
        raise LfsrError(f"a photograph was taken at z = {photograph.eye_mm[2]:g} mm, but it must be in front of the "
                        "panel, above 0")
    view = find_panel(photograph.image, profile)
    eye, found_at = photograph.eye_mm, view.camera(photograph.eye_mm[2])
    if np.abs(found_at - eye[:2]).max() > PLACE * eye[2] + PLACE_MM:
        raise LfsrError(f"the photograph was taken from about {found_at[0]:.0f},{found_at[1]:.0f} by its perspective, "
                        f"but from {eye[0]:g},{eye[1]:g} was stated: correct the place, or give the whole, uncropped "
                        "photograph")
    geometry, (waves, phases) = Geometry.of(profile), elemental_waves(profile)
    nearer = (1 + geometry.gap / geometry.distance) / (1 + geometry.gap / photograph.eye_mm[2])
    found: list[list[Fringes]] = [[], []]
    for channel, other in (FRINGE_CHANNELS, FRINGE_CHANNELS[::-1]):
        picture = _picture(profile, photograph.image, view, channel)
        for axis, lenses in tones(profile, channel):
            shown = (1 + 1 / lenses) * waves[axis]
            mixed = next(1 + 1 / length for number, length in tones(profile, other) if number == axis)
            fringes = find_fringes(picture, shown - nearer * waves[axis], mixed * waves[axis] - shown)
            found[axis].append(fringes.seen_through(shown, (1 + 1 / lenses) * phases[axis]))
    return Seen(view, tuple(_mean(tones, view, profile) for tones in found if tones), photograph.eye_mm)


def combine(profile: DisplayProfile, seen: Sequence[Seen]) -> Calibration:
    """Return the calibration of photographs; LfsrError if they disagree or are too uncertain."""
    fitted = profile
    for _ in range(ROUNDS):
        # Waves (n, 2) of the lenses per millimetre and their phases (n,) at the middle; n: 1 for cylinders, else 2.
        found: list[tuple[Array, Array]] = []
        for one in seen:
            behind = Geometry.of(fitted).gap / one.eye_mm[2]
            apparent = np.array([fringes.wave for fringes in one.lenses])
            seen_phases = np.array([fringes.phase for fringes in one.lenses])
            found.append((apparent * (1 + behind), seen_phases + apparent @ np.array(one.eye_mm[:2]) * behind))
        waves, phases = (np.array(values) for values in zip(*found, strict=True))
        phases = phases[0] + (phases - phases[0] + 0.5) % 1 - 0.5  # of the same lens
        fitted = _with_sheet(profile, fitted, np.mean(waves, 0), phases.mean(0))
    # Photographs must not place a lens differently, at the panel's middle or at a corner.
    corners = np.array([[0, 0], [-1, -1], [-1, 1], [1, -1], [1, 1]]) / 2 * profile.panel_mm
    lenses = np.array([corners @ wave.T - phase for wave, phase in zip(waves, phases, strict=True)])
    apart = float(np.ptp(lenses, axis=0).max())
    if apart > MAX_DIFFERENCE:
        raise LfsrError(f"the photographs disagree by {apart:.2f} of a lens pitch: check the places that they were "
                        "taken from, and the profile's viewing angle and distance")
    errors = _errors(seen, waves, phases)
    across = min(profile.panel_mm[:1] if profile.lenticular else profile.panel_mm) / max(profile.sheet.pitches)
    allowed = max(PITCH, LENSES / across)
    if errors.pitch * SURE > allowed or errors.turn * SURE > TURN:
        raise LfsrError(f"the pitch is known only to {errors.pitch * SURE:.1e} of it and the rotation to "
                        f"{errors.turn * SURE:.1e}, but {allowed:.1e} and {TURN:g} are needed: fill the photograph "
                        "with the panel, hold the camera still, or give several photographs")
    distance = float(np.mean([one.eye_mm[2] for one in seen]))
    behind = Geometry.of(fitted).gap / distance
    return Calibration(fitted, tuple(seen), errors, behind / distance / (1 + behind))


def _picture(profile: DisplayProfile, image: Array, view: View, channel: int) -> Picture:
    """A channel of the panel from the front, with at least PER_LENS pixels for a lens if the photograph has them."""
    size = np.array(profile.panel_mm)
    ends = view.places(np.array([[-1, 0], [1, 0]]) / 2 * size)
    whole = Raster.of(image[..., channel])
    pixels = float(np.linalg.norm(ends[1] - ends[0])) * whole.half
    wanted = size[0] / min(profile.sheet.pitches) * PER_LENS
    times = max(1, int(pixels / max(wanted, 400)))
    points = grid(size, int(min(pixels / times, MOST_ACROSS)))
    x, y = points[0, :, 0], points[:, 0, 1]
    light = dots(profile).shown(points[..., 0], points[..., 1])
    return Picture(whole.shrunk(times).at(view.places(points)), x, y, light)


def _mean(found: list[Fringes], view: View, profile: DisplayProfile) -> Fringes:
    """Mean of the fringes of several channels, whose errors know how well the panel's places are known."""
    (width, height), lengths = profile.panel_mm, np.array([np.linalg.norm(one.seen) for one in found])
    # A wrong place of the panel moves all fringes alike, the more the closer they are.
    place = float((view.offsets ** 2).mean()) / len(view.offsets) * np.array([12 / width ** 2, 12 / height ** 2, 1])
    weights = 1 / (np.array([np.trace(one.errors[:2, :2]) for one in found]) + place[:2].sum() * lengths ** 2)
    weights /= weights.sum()
    values = np.array([[*one.wave, found[0].phase + (one.phase - found[0].phase + 0.5) % 1 - 0.5] for one in found])
    mean = weights @ values
    inside = np.einsum("n,nij->ij", weights ** 2, [one.errors for one in found])
    apart = np.sqrt(weights @ (values - mean) ** 2)
    inside *= max(1.0, float((apart ** 2 / (np.diag(inside) + place * np.ptp(lengths) ** 2)).max()))
    errors = inside + np.diag(place) * (weights @ lengths) ** 2
    return Fringes(mean[:2], float(mean[2]), errors)


def _errors(seen: Sequence[Seen], found: Array, phases: Array) -> Errors:
    """What windows and photographs scatter by, the larger of both, of the axis that is known least."""
    count = len(seen)
    results = []
    for axis in range(len(phases[0])):
        waves = found[:, axis]
        length, normal = np.linalg.norm(waves.mean(0)), waves.mean(0) / np.linalg.norm(waves.mean(0))
        # Variances (3,) of a wave along ``normal``, across it, and of the phase.
        turned = np.array([[*normal, 0], [-normal[1], normal[0], 0], [0, 0, 1]])
        inside = np.sqrt(np.mean([np.diag(turned @ one.lenses[axis].errors @ turned.T) for one in seen], 0) / count)
        along = np.array([normal, [-normal[1], normal[0]]])
        between = np.append((waves @ along.T), phases[:, axis:axis + 1], -1).std(0, ddof=1) / math.sqrt(count) \
            if count > 1 else np.zeros(3)
        results.append(np.maximum(inside, between) / [length, length, 1])
    return Errors(*(float(value) for value in np.max(results, 0)))


def _with_sheet(profile: DisplayProfile, before: DisplayProfile, waves: Array, phases: Array) -> DisplayProfile:
    """``profile`` with lenses of these waves and phases; the gap is that of ``before``."""
    sheet = profile.sheet
    if isinstance(sheet, Lenticular):
        geometry, (width, height) = Geometry.of(before), before.panel_mm
        wave = waves[0] / (1 + geometry.gap / geometry.distance)  # of elemental images, further apart than lenses
        slant = float(wave[1] / wave[0])
        center = float(phases[0]) + float(wave[0]) * width / 2 * (1 + slant * height / width) - 0.5
        return dataclasses.replace(profile, lenticular=dataclasses.replace(
            sheet, pitch_mm=float(1 / np.linalg.norm(wave)), slant=slant, center=center % 1))
    matrix = np.linalg.inv(waves)
    turn = math.atan2(matrix[1, 0], matrix[0, 0])
    across, up = float(np.hypot(*matrix[:, 0])), float(-math.sin(turn) * matrix[0, 1] + math.cos(turn) * matrix[1, 1])
    lean = math.cos(turn) * matrix[0, 1] + math.sin(turn) * matrix[1, 1]
    lean -= across / 2 if sheet.packing == "hexagonal" else 0
    # Of all lenses, the one nearest to its nominal place.
    nominal = waves @ np.array(sheet.lenses.shift_mm)
    shift = matrix @ (nominal + (phases - nominal + 0.5) % 1 - 0.5)
    lenses = Lattice((across, up), math.degrees(turn), float(lean / up), (float(shift[0]), float(shift[1])))
    return dataclasses.replace(profile, lenslet=dataclasses.replace(
        sheet, lenses=lenses, elemental_images=None, gap_mm=Geometry.of(profile).gap))
