"""Calibrate a display by photograph files: the profile, the picture beside it, and what to tell."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lfsr_core.base.errors import LfsrError
from lfsr_core.calibration.fit import Calibration, Photograph, combine, see
from lfsr_core.calibration.photo import read_photograph
from lfsr_core.calibration.photograph import View
from lfsr_core.calibration.prediction import comparison
from lfsr_core.images.png import write_png
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.profile_file import write_profile

Place = tuple[float, float, float]
WORTH_SAYING = 0.005  # distortion of the lens at the photograph's corner


def calibrate(profile: DisplayProfile, photos: Sequence[Path], places: Sequence[Place],
              output: Path | None) -> tuple[Calibration, list[str]]:
    """Return the calibration by photographs of the phase pattern, taken from ``places``, and lines that describe it.

    Written, if ``output`` (.toml) is given: the profile, and beside it a PNG with the photographs as taken and as the
    profile predicts them. LfsrError names the photograph that is not accepted.
    """
    photographs = [Photograph(read_photograph(photo), place) for photo, place in zip(photos, places, strict=True)]
    seen = []
    for photo, photograph in zip(photos, photographs, strict=True):
        try:
            seen.append(see(profile, photograph))
        except LfsrError as error:
            raise LfsrError(f"{photo.name}: {error}") from None
    found = combine(profile, seen)
    picture = comparison(profile, found, photographs)
    lines = _accuracy(found)
    for photo, one in zip(photos, seen, strict=True):
        lines += _view(photo, one.view)
    if output:
        write_profile(output, found.profile)
        write_png(output.with_suffix(".png"), picture)
        lines.append(f"taken and predicted: {output.with_suffix('.png')}")
    return found, lines


def _accuracy(found: Calibration) -> list[str]:
    errors, count = found.errors, len(found.seen)
    by = "1 photograph" if count == 1 else f"{count} photographs"
    return [f"by {by}: pitch ±{errors.pitch:.1e} of it, rotation ±{errors.turn:.1e}, shift ±{errors.shift:.4f} of a "
            "lens pitch (standard deviations)",
            f"an error of 1 mm in the camera's distance changes the pitch by {found.per_mm:.1e} of it"]


def _view(photo: Path, view: View) -> list[str]:
    """What the photograph's marks say about how it was taken."""
    lines = []
    if view.mirrored:
        lines.append(f"note: {photo.name} is mirrored and was mirrored back; if the panel itself mirrors its image, "
                     "set flip in the profile")
    if view.turn_deg:
        lines.append(f"note: {photo.name} shows the panel turned by {view.turn_deg}° and was turned back; camera "
                     "positions count along the pattern's own right and up")
    if abs(view.bent) > WORTH_SAYING:
        lines.append(f"note: the lens of {photo.name} distorts by {abs(view.bent):.1%} at the corner, now corrected")
    return lines
