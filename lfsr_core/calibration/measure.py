"""Calibrate a display by photograph files: the profile, the picture beside it, and what to tell."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice
from lfsr_core.calibration.fit import Calibration, Photograph, combine, see
from lfsr_core.calibration.photo import read_photograph
from lfsr_core.calibration.prediction import comparison
from lfsr_core.images.png import write_png
from lfsr_core.optics.display import DisplayProfile, write_profile

Place = tuple[float, float, float]
WORTH_SAYING = 0.005  # distortion of the lens at the photograph's corner


def calibrate(profile: DisplayProfile, photos: Sequence[Path], places: Sequence[Place],
              output: Path | None) -> tuple[Calibration, list[Notice]]:
    """Return the calibration by photographs of the phase pattern, taken from ``places``, and what to know of it.

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
    if output:
        write_profile(output, found.profile)
        write_png(output.with_suffix(".png"), picture)
    errors = found.errors
    notices = [Notice("calibrated", {"photographs": len(photos), "pitch": errors.pitch, "turn": errors.turn,
                                     "shift": errors.shift}),
               Notice("calibrated-at-distance", {"pitch": found.per_mm})]
    for name, view in ((photo.name, one.view) for photo, one in zip(photos, seen, strict=True)):
        if view.mirrored:
            notices.append(Notice("photograph-mirrored", {"photograph": name}))
        if view.turn_deg:
            notices.append(Notice("photograph-turned", {"photograph": name, "degrees": view.turn_deg}))
        if abs(view.bent) > WORTH_SAYING:
            notices.append(Notice("lens-distorts", {"photograph": name, "fraction": abs(view.bent)}))
    return found, notices
