"""The photographs that a calibrated profile predicts, beside those that were taken.

The prediction traces rays from the camera through the lenses (``trace.py``), which shares no formula with the fit.
"""

from __future__ import annotations

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.calibration.fit import Calibration, Photograph
from lfsr_core.calibration.patterns import FRINGE_CHANNELS, pattern
from lfsr_core.calibration.photograph import Raster, grid
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.subpixel_rays import Geometry
from lfsr_core.optics.panel.trace import seen_at

ACROSS, EDGE = 720, 12  # pixels of one picture, and between pictures
BLOCK = 4  # pixels whose mean is compared: lenses themselves are no matter
LEAST_ALIKE = 0.6  # correlation of both


def comparison(profile: DisplayProfile, calibration: Calibration, photographs: list[Photograph]) -> Array:
    """Return a picture (H, W, 3) uint8: a row for each photograph, taken on the left, predicted on the right.

    ``profile``: for which the pattern was drawn. LfsrError if the two are not alike.
    """
    shown, fitted = pattern(profile, "phase"), calibration.profile
    rows = []
    for photograph, seen in zip(photographs, calibration.seen, strict=True):
        # The panel of the photograph from the front.
        points, raster = grid(np.array(profile.panel_mm), ACROSS), Raster.of(photograph.image)
        ends = seen.view.places(points[0, [0, -1]])
        times = int(np.linalg.norm(ends[1] - ends[0]) * raster.half / ACROSS)
        taken = raster.shrunk(times).at(seen.view.places(points))
        # What the camera sees of the pattern through the fitted lenses, at the same points of the panel.
        behind = Geometry.of(fitted).gap / seen.eye_mm[2]
        x, y = ((axis + place * behind) / (1 + behind)
                for axis, place in zip((points[0, :, 0], points[:, 0, 1]), seen.eye_mm, strict=False))
        predicted = seen_at(shown, fitted, seen.eye_mm, x, y) / 255
        # Correlation of the channels of the fringes, the lesser.
        high, wide = (count // BLOCK for count in taken.shape[:2])
        blocks = [image[:high * BLOCK, :wide * BLOCK].reshape(high, BLOCK, wide, BLOCK, 3).mean((1, 3))
                  for image in (taken, predicted)]
        alike = min(float(np.corrcoef(*(block[..., channel].ravel() for block in blocks))[0, 1])
                    for channel in FRINGE_CHANNELS)
        if alike < LEAST_ALIKE:
            raise LfsrError(f"the photograph and what the fitted lenses would show agree by {alike:.0%} only: start "
                            "from the maker's figures, and photograph the pattern of this very profile")
        rows.append(np.concatenate([taken, np.ones((len(taken), EDGE, 3)), predicted], 1))
        rows.append(np.ones((EDGE, rows[0].shape[1], 3)))
    return np.asarray(np.rint(np.clip(np.concatenate(rows[:-1]), 0, 1) * 255), np.uint8)
