"""Measure a lens sheet's pitch, rotation and shift from photographs of the phase pattern taken from known places.

Through each lens a camera sees one point of the panel. The pattern's fringes are slightly closer together than
elemental images, so the camera sees one fringe over ``carrier`` lenses. Let k be the waves of the elemental images on
the panel, K those of the lenses, E the camera's place at height z, and m = 1 + 1/carrier. The fringes that are seen
have the wave m·(1 + gap/z)·k − K and, at the middle of the plane, the phase K·shift − m·(k·E·gap/z + phase of k). Both
are linear in the unknowns K and shift.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.patterns import carrier, dots
from lfsr_core.optics.panel.photograph import find_homography, project, sample_bilinear
from lfsr_core.optics.panel.subpixel_rays import Geometry, elemental_waves
from lfsr_core.optics.sheet import Lattice, Lenslet, Lenticular

GRID = (1536, 1024)  # most points, across and down, at which a photograph is sampled
MARGIN = 0.94  # fraction of the plane that is sampled
MIN_CONTRAST = 0.02  # amplitude of fringes, where white is 1
MIN_FRACTION = 0.08  # of a channel's variation that its fringes must make up
REACH = 0.45  # most difference of the wave that is seen from the expected one, as a fraction of the latter
MAX_DIFFERENCE = 0.05  # between the shifts of several photographs, in elemental images


@dataclasses.dataclass(frozen=True)
class Photograph:
    """A photograph of the phase pattern and where it was taken."""

    image: Array  # (H, W, 3) from 0 to 1
    eye_mm: tuple[float, float, float]  # camera, from the middle of the lenses, y up, z towards the viewer


def fit_profile(profile: DisplayProfile, photographs: Sequence[Photograph]) -> DisplayProfile:
    """Return ``profile``, for which the pattern was drawn, with the lens sheet that the photographs show.

    LfsrError if no panel, dots or fringes are found, or if photographs disagree.
    """
    found = [_lens_waves(profile, photograph) for photograph in photographs]
    waves = np.mean([wave for wave, _ in found], 0)
    phases = np.array([phase for _, phase in found])
    phases = phases[0] + (phases - phases[0] + 0.5) % 1 - 0.5  # of the same lens
    apart = float(np.ptp(phases, axis=0).max())
    if apart > MAX_DIFFERENCE:
        raise LfsrError(f"the photographs disagree by {apart:.2f} of a lens pitch: check the places that they were "
                        "taken from, and the profile's viewing angle and distance")
    sheet, phases = profile.sheet, phases.mean(0)
    if isinstance(sheet, Lenticular):
        return dataclasses.replace(profile, lenticular=_lenticular(profile, sheet, waves, phases))
    return dataclasses.replace(profile, lenslet=_lenslet(profile, sheet, waves, phases))


def _lens_waves(profile: DisplayProfile, photograph: Photograph) -> tuple[Array, Array]:
    """Waves (n, 2) of the lenses per millimetre and their phases (n,) at the middle; n is 1 for cylinders, else 2."""
    geometry, (eye_x, eye_y, height) = Geometry.of(profile), photograph.eye_mm
    if height <= 0:
        raise LfsrError(f"a photograph was taken at z = {height} mm, but it must be in front of the panel, above 0")
    behind, many = geometry.gap / height, 1 + 1 / carrier(profile)
    eye = np.array([eye_x, eye_y])
    centers, spread = dots(profile)
    size = profile.panel_mm[0] / (1 + behind), profile.panel_mm[1] / (1 + behind)
    middle = eye * behind / (1 + behind)
    seen = centers / (1 + behind)
    matrix = find_homography(photograph.image[..., 2], size, seen, spread / (1 + behind))
    waves, phases = elemental_waves(profile)
    found = []
    for axis in range(1 if profile.lenticular else 2):
        on_panel = many * (1 + behind) * waves[axis]
        expected = on_panel - waves[axis] * (1 + geometry.gap / geometry.distance)
        wave, phase = find_fringes(_rectified(photograph.image[..., axis], matrix, size), size, expected)
        # So far places on the plane count from where the panel's middle is seen.
        phase = phase - wave @ middle
        found.append((on_panel - wave, phase + many * (waves[axis] @ eye * behind + phases[axis])))
    return np.array([wave for wave, _ in found]), np.array([phase for _, phase in found])


def _rectified(image: Array, matrix: Array, size: tuple[float, float]) -> Array:
    """The middle of the plane seen from the front, rows from the top."""
    columns, rows = (min(most, round(length)) for most, length in zip(GRID, _extent(matrix, size), strict=True))
    x, y = ((np.arange(count) + 0.5) / count - 0.5 for count in (columns, rows))
    places = np.stack(np.meshgrid(x * size[0] * MARGIN, -y * size[1] * MARGIN), -1)
    return sample_bilinear(image, project(matrix, places))


def _extent(matrix: Array, size: tuple[float, float]) -> tuple[float, float]:
    """Pixels of the photograph that the plane's width and height cover."""
    ends = project(matrix, np.array([[-1, 0], [1, 0], [0, -1], [0, 1]]) / 2 * np.array(size))
    return float(np.linalg.norm(ends[1] - ends[0])), float(np.linalg.norm(ends[3] - ends[2]))


def find_fringes(image: Array, size: tuple[float, float], expected: Array) -> tuple[Array, float]:
    """Return the strongest wave (2,) of an image near the ``expected`` one, and its phase at the middle in waves.

    ``image`` (rows, columns) shows the fraction MARGIN of a plane of ``size`` millimetres; waves are per millimetre.
    LfsrError if there is no clear wave.
    """
    rows, columns = image.shape
    x, y = (((np.arange(count) + 0.5) / count - 0.5) * length * MARGIN * sign
            for count, length, sign in ((columns, size[0], 1), (rows, size[1], -1)))
    window = np.hanning(rows + 2)[1:-1, None] * np.hanning(columns + 2)[None, 1:-1]
    light = image - (image * window).sum() / window.sum()
    weighted = light * window
    reach = REACH * float(np.linalg.norm(expected))
    wave, step, around = np.array(expected, float), reach / 12, 12
    while step * max(size) > 1e-5:
        wave, step, around = _strongest(weighted, (x, y), wave, np.arange(-around, around + 1) * step), step / 4, 5
    value = _spectrum(weighted, (x, y), wave[:1], wave[1:])[0, 0] / window.sum()
    contrast = 2 * abs(value)
    variation = float((light ** 2 * window).sum() / window.sum())
    fraction = contrast ** 2 / 2 / max(variation, 1e-12)
    if contrast < MIN_CONTRAST or fraction < MIN_FRACTION or np.linalg.norm(wave - expected) > 0.95 * reach:
        raise LfsrError(f"no clear fringes are seen (contrast {contrast:.3f}, {fraction:.0%} of the variation): the "
                        "lenses may be too small in the photograph or the profile too far from the sheet")
    return wave, float(np.angle(value) / (2 * math.pi))


def _strongest(weighted: Array, places: tuple[Array, Array], wave: Array, steps: Array) -> Array:
    """The wave near ``wave`` with the strongest response."""
    across, up = wave[0] + steps, wave[1] + steps
    row, column = np.unravel_index(np.abs(_spectrum(weighted, places, across, up)).argmax(), (len(up), len(across)))
    return np.array([across[column], up[row]])


def _spectrum(weighted: Array, places: tuple[Array, Array], across: Array, up: Array) -> Array:
    """(len(up), len(across)) sums of the image times waves of these numbers per millimetre."""
    x, y = places
    right = np.exp(-2j * math.pi * np.outer(x, across))
    sums: Array = np.exp(-2j * math.pi * np.outer(up, y)) @ (weighted @ right)
    return sums


def _lenticular(profile: DisplayProfile, sheet: Lenticular, waves: Array, phases: Array) -> Lenticular:
    geometry, (width, height) = Geometry.of(profile), profile.panel_mm
    wave = waves[0] / (1 + geometry.gap / geometry.distance)  # of elemental images, further apart than lenses
    slant = float(wave[1] / wave[0])
    across = float(wave[0]) * width
    center = float(phases[0]) + across / 2 * (1 + slant * height / width) - 0.5
    return dataclasses.replace(sheet, pitch_mm=float(1 / np.linalg.norm(wave)), slant=slant, center=center % 1)


def _lenslet(profile: DisplayProfile, sheet: Lenslet, waves: Array, phases: Array) -> Lenslet:
    matrix = np.linalg.inv(waves)
    turn = math.atan2(matrix[1, 0], matrix[0, 0])
    across, up = float(np.hypot(*matrix[:, 0])), float(-math.sin(turn) * matrix[0, 1] + math.cos(turn) * matrix[1, 1])
    lean = math.cos(turn) * matrix[0, 1] + math.sin(turn) * matrix[1, 1]
    lean -= across / 2 if sheet.packing == "hexagonal" else 0
    # Of all lenses, the one nearest to its nominal place.
    nominal = waves @ np.array(sheet.lenses.shift_mm)
    shift = matrix @ (nominal + (phases - nominal + 0.5) % 1 - 0.5)
    lenses = Lattice((across, up), math.degrees(turn), float(lean / up), (float(shift[0]), float(shift[1])))
    return dataclasses.replace(sheet, lenses=lenses, elemental_images=None, gap_mm=Geometry.of(profile).gap)
