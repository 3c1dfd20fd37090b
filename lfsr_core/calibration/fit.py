"""Measure a lens sheet's pitch, rotation and shift from photographs of the phase pattern taken from known places.

Through each lens a camera sees one point of the panel. The pattern's fringes are slightly closer together than
elemental images, so the camera sees one fringe over several lenses (``tones``). Let k be the waves of the elemental
images on the panel, K those of the lenses, E the camera's place at height z, b = gap/z and m = 1 + 1/carrier. A lens
at c shows the panel's point (1 + b)·c − b·E, so in panel coordinates the seen fringes have the wave
m·k − K/(1 + b) and, at its centre, the phase K·shift − b·K·E/(1 + b) − m·(phase of k). Both are linear in the unknowns
K and shift. The wave of fringes is measured roughly by the strongest response, then by the phase in windows all
over the panel. The residuals of these phases give the uncertainty of the wave.
"""

import dataclasses
import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError, Notice
from lfsr_core.calibration.patterns import FRINGE_CHANNELS, dots, pattern, tones
from lfsr_core.calibration.photograph import Raster, View, find_panel, grid, read_photograph
from lfsr_core.images.image_files import write_png
from lfsr_core.optics.display import DisplayProfile, Lattice, Lenticular, write_profile
from lfsr_core.optics.eye import seen_at
from lfsr_core.optics.panel.subpixel_rays import Geometry, elemental_waves

PER_LENS = 3  # pixels of a photograph that are enough for a lens
PLACE, PLACE_MM = 0.06, 5.0  # most error of the stated place: a fraction of the distance, plus millimetres
PITCH, LENSES, TURN = 1e-5, 2e-3, 1e-4  # most errors: of the pitch, all over the panel in pitches, of the rotation
SURE = 2.2  # standard deviations as estimated; errors of simulated photographs deviated by 0.7 of one
ROUNDS = 3  # of the fit: the gap follows from the pitch, and settles
# Of the picture that compares photographs with what a profile predicts.
ACROSS, EDGE = 720, 12  # pixels of one picture, and between pictures
BLOCK = 4  # compares means of BLOCK × BLOCK pixels, so that single lenses do not matter
LEAST_ALIKE = 0.6  # correlation of photograph and prediction
MIN_CONTRAST = 0.02  # amplitude of fringes, where white is 1
MIN_FRACTION = 0.08  # of a channel's variation that its fringes must make up
REACH = 0.45  # most difference of the seen wave from the expected one, as a fraction of the expected one
MOST_WINDOWS, LEAST_WINDOWS, FRINGES = 9, 3, 3.0  # windows along each side, each of this many fringes if there is room
OVERLAP = 4 / 3  # neighbouring windows share a sixth of their errors, so the mean errs by this much more


class Picture(NamedTuple):
    """A channel of the panel seen from the front, in millimetres from the panel's centre."""

    values: Array  # (rows, columns)
    x: Array  # (columns,)
    y: Array  # (rows,), upwards
    dots: Array  # (rows, columns) the dots, whose light a camera that mixes colours adds


@dataclasses.dataclass(frozen=True)
class Fringes:
    """A wave: cos of 2π (wave · place + phase)."""

    wave: Array  # (2,) per millimetre
    phase: float  # at the panel's centre
    errors: Array  # (3, 3) covariance of wave and phase
    seen: Array = dataclasses.field(default_factory=lambda: np.zeros(2))  # the wave in the photograph


def find_fringes(picture: Picture, expected: Array, other: Array) -> Fringes:
    """Return the fringes whose wave lies near the ``expected`` one (2,).

    ``other`` (2,): the wave of the other channel's fringes, which a camera that mixes colours adds, minus this one.
    LfsrError if they are not clear, hidden in places, or bent.
    """
    # The wave with the strongest response.
    rows, columns = picture.values.shape
    window = np.hanning(rows + 2)[1:-1, None] * np.hanning(columns + 2)[None, 1:-1]
    light = picture.values - (picture.values * window).sum() / window.sum()
    weighted, reach = light * window, REACH * float(np.linalg.norm(expected))
    wave, step, around = np.array(expected, float), reach / 12, 12
    while step * max(np.ptp(picture.x), np.ptp(picture.y)) > 1e-3:
        steps = np.arange(-around, around + 1) * step
        right, up = wave[0] + steps, wave[1] + steps
        sums = np.abs(_spectrum(weighted, picture, right, up))
        row, column = np.unravel_index(sums.argmax(), sums.shape)
        wave, step, around = np.array([right[column], up[row]]), step / 4, 5
    contrast = 2 * abs(_spectrum(weighted, picture, wave[:1], wave[1:])[0, 0] / window.sum())
    fraction = contrast ** 2 / 2 / max(float((light ** 2 * window).sum() / window.sum()), 1e-12)
    if contrast < MIN_CONTRAST or fraction < MIN_FRACTION or np.linalg.norm(wave - expected) > 0.95 * reach:
        raise LfsrError(f"no clear fringes are seen (contrast {contrast:.3f}, {fraction:.0%} of the variation): the "
                        "photograph may be blurred, the lenses too small in it, or the profile too far from the sheet")

    # The centre (x, y) of each window, and the cosine and sine of its light at the wave; neighbours overlap by half.
    most = float(np.abs(wave * [np.ptp(picture.x), np.ptp(picture.y)]).max())
    count = int(np.clip(2 * most / FRINGES - 1, LEAST_WINDOWS, MOST_WINDOWS))
    centres, factors = [], []
    for number in itertools.product(range(count), range(count)):
        high, wide = (slice(*(round(len(axis) * (one + step) / (count + 1)) for step in (0, 2)))
                      for axis, one in zip((picture.y, picture.x), number, strict=True))
        x, y = picture.x[wide], picture.y[high]
        weights = np.sqrt(np.hanning(len(y) + 2)[1:-1, None] * np.hanning(len(x) + 2)[None, 1:-1]).ravel()
        turn, added = (2 * math.pi * np.add.outer(y * one[1], x * one[0]).ravel() for one in (wave, wave + other))
        values, light = picture.values[high, wide].ravel(), picture.dots[high, wide].ravel()
        slope_x, slope_y = (np.broadcast_to(part, (len(y), len(x))).ravel()
                            for part in (x - x.mean(), (y - y.mean())[:, None]))
        terms = np.stack([np.cos(turn), np.sin(turn), np.cos(added), np.sin(added), np.ones_like(turn),
                          slope_x / np.abs(slope_x).max(), slope_y / np.abs(slope_y).max(), light - light.mean()], -1)
        terms *= weights[:, None]
        square = terms.T @ terms
        factors.append(np.linalg.solve(square + 1e-9 * np.trace(square) * np.eye(8), terms.T @ (values * weights))[:2])
        centres.append([x.mean(), y.mean()])
    places, fitted = np.array(centres), np.array(factors)
    first = fitted[:, 0] - 1j * fitted[:, 1]
    seen = np.abs(first) >= 0.35 * np.median(np.abs(first))
    if (~seen).mean() > 0.06:  # of the windows
        x, y = places[~seen].mean(0) / np.abs(places).max(0)
        down = "upper " if y > 0.3 else "lower " if y < -0.3 else ""
        across = "right" if x > 0.3 else "left" if x < -0.3 else "part" if down else "middle"
        raise LfsrError(f"the {down}{across} of the panel shows no fringes: uncover the whole panel, and keep lamps "
                        "and windows from being mirrored in it")
    # The wave whose phases come nearest to those of the windows.
    places, first = places[seen], first[seen]
    middle = np.angle(first.sum())
    phases = np.angle(first * np.exp(-1j * middle)) / 2 / math.pi
    terms = np.concatenate([places, np.ones((len(places), 1))], -1)
    solved, *_ = np.linalg.lstsq(terms, phases, rcond=None)
    rest = phases - terms @ solved
    scatter = math.sqrt(float((rest ** 2).sum()) / max(len(rest) - 3, 1))
    if scatter > 0.06:  # fringes
        raise LfsrError(f"the fringes are not straight (they scatter by {scatter:.2f} of a fringe): take the whole, "
                        "uncropped photograph with the main camera, sharp, without zoom")
    return Fringes(wave + solved[:2], float(solved[2] + middle / 2 / math.pi),
                   np.linalg.inv(terms.T @ terms) * (scatter * OVERLAP) ** 2)


def _spectrum(weighted: Array, picture: Picture, across: Array, up: Array) -> Array:
    """(len(up), len(across)) sums of the image times waves of these numbers per millimetre."""
    right = np.exp(-2j * math.pi * np.outer(picture.x, across))
    return np.asarray(np.exp(-2j * math.pi * np.outer(up, picture.y)) @ (weighted @ right))


@dataclasses.dataclass(frozen=True)
class Seen:
    """What one photograph of the phase pattern shows."""

    image: Array  # (H, W, 3) from 0 to 1
    view: View
    lenses: tuple[Fringes, ...]  # waves of the lenses as they lie before the panel; cylinders: one, small lenses: two
    eye_mm: tuple[float, float, float]  # camera, from the middle of the lenses, y up, z towards the viewer


@dataclasses.dataclass(frozen=True)
class Calibration:
    """A profile with the lens sheet of photographs, and how far to trust it."""

    profile: DisplayProfile
    seen: tuple[Seen, ...]
    # standard deviations: of the pitch as a fraction of it, of the rotation in radians, of the shift in lens pitches
    errors: tuple[float, float, float]
    per_mm: float  # relative change of the pitch for each millimetre of error in the camera's distance


def calibrate(profile: DisplayProfile, photos: Sequence[Path], places: Sequence[tuple[float, float, float]],
              output: Path | None) -> tuple[DisplayProfile, list[Notice]]:
    """Return the profile fitted to photographs of the phase pattern, and notices about it.

    ``places``: of the camera, in millimetres, as ``Seen.eye_mm``. ``output`` (.toml): write the profile there, and a
    PNG beside it with the photographs as taken and as predicted. LfsrError names the photograph that is not accepted.
    """
    if output and (picture_file := output.with_suffix(".png")).resolve() in [photo.resolve() for photo in photos]:
        raise LfsrError(f"{picture_file} is a photograph, but the comparison would replace it: choose another name "
                        f"than {output.name}")
    images, seen = [read_photograph(photo) for photo in photos], []
    for photo, image, place in zip(photos, images, places, strict=True):
        try:
            seen.append(see(profile, image, place))
        except LfsrError as error:
            raise LfsrError(f"{photo.name}: {error}") from None
    calibration = combine(profile, seen)
    picture = comparison(profile, calibration)
    if output:
        write_profile(output, calibration.profile)
        write_png(output.with_suffix(".png"), picture)
    pitch, turn, shift = calibration.errors
    notices = [Notice("calibrated", {"photographs": len(photos), "pitch": pitch, "turn": turn, "shift": shift}),
               Notice("calibrated-at-distance", {"pitch": calibration.per_mm})]
    for name, view in ((photo.name, one.view) for photo, one in zip(photos, seen, strict=True)):
        if view.mirrored:
            notices.append(Notice("photograph-mirrored", {"photograph": name}))
        if view.turn_deg:
            notices.append(Notice("photograph-turned", {"photograph": name, "degrees": view.turn_deg}))
        if abs(view.bent) > 0.005:  # at the photograph's corner
            notices.append(Notice("lens-distorts", {"photograph": name, "fraction": abs(view.bent)}))
    return calibration.profile, notices


def see(profile: DisplayProfile, image: Array, eye: tuple[float, float, float]) -> Seen:
    """Return the panel and its fringes in one photograph (H, W, 3), as of ``Seen``; LfsrError if they are not found."""
    if eye[2] <= 0:
        raise LfsrError(f"a photograph was taken at z = {eye[2]:g} mm, but it must be in front of the panel, above 0")
    view = find_panel(image, profile)
    found_at = view.camera(eye[2])
    if np.abs(found_at - eye[:2]).max() > PLACE * eye[2] + PLACE_MM:
        raise LfsrError(f"the photograph was taken from about {found_at[0]:.0f},{found_at[1]:.0f} by its perspective, "
                        f"but from {eye[0]:g},{eye[1]:g} was stated: correct the place, or give the whole, uncropped "
                        "photograph")
    geometry, (waves, phases) = Geometry.of(profile), elemental_waves(profile)
    nearer = (1 + geometry.gap / geometry.distance) / (1 + geometry.gap / eye[2])
    # The panel from the front, with at least PER_LENS pixels for a lens if the photograph has them.
    size, half = np.array(profile.panel_mm), Raster.of(image).half
    ends = view.places(np.array([[-1, 0], [1, 0]]) / 2 * size)
    pixels = float(np.linalg.norm(ends[1] - ends[0])) * half
    times = max(1, int(pixels / max(size[0] / min(profile.sheet.pitches) * PER_LENS, 400)))
    points = grid(size, int(min(pixels / times, 2048)))
    places, light = view.places(points), dots(profile).shown(points[:1, :, 0], points[:, :1, 1])
    by_axis: list[list[Fringes]] = [[], []]
    for channel, other in (FRINGE_CHANNELS, FRINGE_CHANNELS[::-1]):
        values = Raster.of(image[..., channel]).shrunk(times).at(places)
        picture = Picture(values, points[0, :, 0], points[:, 0, 1], light)
        for axis, lenses in tones(profile, channel):
            shown = (1 + 1 / lenses) * waves[axis]
            mixed = next(1 + 1 / length for number, length in tones(profile, other) if number == axis)
            fringes = find_fringes(picture, shown - nearer * waves[axis], mixed * waves[axis] - shown)
            # The lenses through which the pattern is seen as these fringes.
            by_axis[axis].append(Fringes(shown - fringes.wave, fringes.phase + (1 + 1 / lenses) * phases[axis],
                                         fringes.errors, fringes.wave))
    return Seen(image, view, tuple(_mean(tones, view, profile) for tones in by_axis if tones), eye)


def combine(profile: DisplayProfile, seen: Sequence[Seen]) -> Calibration:
    """Return the calibration of photographs; LfsrError if they disagree or are too uncertain."""
    fitted = profile
    for _ in range(ROUNDS):
        # Waves (n, 2) of the lenses per millimetre and their phases (n,) at the middle; n: 1 for cylinders, else 2.
        lattices: list[tuple[Array, Array]] = []
        for one in seen:
            behind = Geometry.of(fitted).gap / one.eye_mm[2]
            apparent = np.array([fringes.wave for fringes in one.lenses])
            seen_phases = np.array([fringes.phase for fringes in one.lenses])
            lattices.append((apparent * (1 + behind), seen_phases + apparent @ np.array(one.eye_mm[:2]) * behind))
        waves, phases = (np.array(values) for values in zip(*lattices, strict=True))
        phases = phases[0] + (phases - phases[0] + 0.5) % 1 - 0.5  # of the same lens
        fitted = _with_sheet(profile, fitted, np.mean(waves, 0), phases.mean(0))
    # Photographs must not place a lens differently, at the panel's middle or at a corner.
    corners = np.array([[0, 0], [-1, -1], [-1, 1], [1, -1], [1, 1]]) / 2 * profile.panel_mm
    lenses = np.array([corners @ wave.T - phase for wave, phase in zip(waves, phases, strict=True)])
    apart = float(np.ptp(lenses, axis=0).max())
    if apart > 0.05:  # lens pitches
        raise LfsrError(f"the photographs disagree by {apart:.2f} of a lens pitch: check the places that they were "
                        "taken from, and the profile's viewing angle and distance")
    # The uncertainty: the scatter of windows or of photographs, whichever is larger, of the least certain axis.
    results = []
    for axis in range(len(phases[0])):
        along = waves[:, axis].mean(0)
        length = np.linalg.norm(along)
        # Variances (3,) of a wave along the axis, across it, and of the phase.
        turned = np.eye(3)
        turned[:2, :2] = np.array([along, [-along[1], along[0]]]) / length
        inside = np.sqrt(np.mean([np.diag(turned @ one.lenses[axis].errors @ turned.T) for one in seen], 0) / len(seen))
        between = (np.append(waves[:, axis] @ turned[:2, :2].T, phases[:, axis:axis + 1], -1).std(0, ddof=1)
                   / math.sqrt(len(seen)) if len(seen) > 1 else np.zeros(3))
        results.append(np.maximum(inside, between) / [length, length, 1])
    pitch, turn, shift = (float(value) for value in np.max(results, 0))
    across = min(profile.panel_mm[:1] if profile.lenticular else profile.panel_mm) / max(profile.sheet.pitches)
    allowed = max(PITCH, LENSES / across)
    if pitch * SURE > allowed or turn * SURE > TURN:
        raise LfsrError(f"the pitch is known only to {pitch * SURE:.1e} of it and the rotation to "
                        f"{turn * SURE:.1e}, but {allowed:.1e} and {TURN:g} are needed: fill the photograph "
                        "with the panel, hold the camera still, or give several photographs")
    distance = float(np.mean([one.eye_mm[2] for one in seen]))
    behind = Geometry.of(fitted).gap / distance
    return Calibration(fitted, tuple(seen), (pitch, turn, shift), behind / distance / (1 + behind))


def _mean(waves: list[Fringes], view: View, profile: DisplayProfile) -> Fringes:
    """Mean of the fringes of several channels; its errors include the uncertainty of the panel's place."""
    (width, height), lengths = profile.panel_mm, np.array([np.linalg.norm(one.seen) for one in waves])
    # A wrong place of the panel moves all fringes alike, the more the closer they are.
    place = float((view.offsets ** 2).mean()) / len(view.offsets) * np.array([12 / width ** 2, 12 / height ** 2, 1])
    weights = 1 / (np.array([np.trace(one.errors[:2, :2]) for one in waves]) + place[:2].sum() * lengths ** 2)
    weights /= weights.sum()
    values = np.array([[*one.wave, waves[0].phase + (one.phase - waves[0].phase + 0.5) % 1 - 0.5] for one in waves])
    mean = weights @ values
    inside = np.einsum("n,nij->ij", weights ** 2, [one.errors for one in waves])
    apart = np.sqrt(weights @ (values - mean) ** 2)
    inside *= max(1.0, float((apart ** 2 / (np.diag(inside) + place * np.ptp(lengths) ** 2)).max()))
    return Fringes(mean[:2], float(mean[2]), inside + np.diag(place) * (weights @ lengths) ** 2)


def _with_sheet(profile: DisplayProfile, before: DisplayProfile, waves: Array, phases: Array) -> DisplayProfile:
    """``profile`` with lenses of these waves and phases; the gap is that of ``before``."""
    if isinstance(sheet := profile.sheet, Lenticular):
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


def comparison(profile: DisplayProfile, calibration: Calibration) -> Array:
    """Return a picture (H, W, 3) uint8: a row for each photograph, taken on the left, predicted on the right.

    The prediction traces rays from the camera through the lenses (``optics/eye.py``), without a formula of the fit.
    ``profile``: for which the pattern was drawn. LfsrError if the two are not alike.
    """
    shown, fitted = pattern(profile, "phase"), calibration.profile
    rows = []
    for seen in calibration.seen:
        # The panel of the photograph from the front.
        points, raster = grid(np.array(profile.panel_mm), ACROSS), Raster.of(seen.image)
        ends = seen.view.places(points[0, [0, -1]])
        times = int(np.linalg.norm(ends[1] - ends[0]) * raster.half / ACROSS)
        taken = raster.shrunk(times).at(seen.view.places(points))
        # What the camera sees of the pattern through the fitted lenses, at the same points of the panel.
        behind = Geometry.of(fitted).gap / seen.eye_mm[2]
        x, y = ((axis + place * behind) / (1 + behind)
                for axis, place in zip((points[0, :, 0], points[:, 0, 1]), seen.eye_mm, strict=False))
        predicted = seen_at(shown, fitted, seen.eye_mm, x, y) / 255
        # The lower of the correlations of the two fringe channels.
        first, second = (Raster.of(image).shrunk(BLOCK).values for image in (taken, predicted))
        alike = min(float(np.corrcoef(first[..., channel].ravel(), second[..., channel].ravel())[0, 1])
                    for channel in FRINGE_CHANNELS)
        if alike < LEAST_ALIKE:
            raise LfsrError(f"the photograph and what the fitted lenses would show agree by {alike:.0%} only: start "
                            "from the maker's figures, and photograph the pattern of this very profile")
        rows.append(np.concatenate([taken, np.ones((len(taken), EDGE, 3)), predicted], 1))
        rows.append(np.ones((EDGE, rows[0].shape[1], 3)))
    return np.asarray(np.rint(np.clip(np.concatenate(rows[:-1]), 0, 1) * 255), np.uint8)
