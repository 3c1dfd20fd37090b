"""How near images come to a reference: the one family of accuracy functions of all studies.

The two halves of a reference have independent noise, so that products of errors against one and the other have none.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array, Mask
from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.foreground import recall
from lfsr_core.frames.frame import Frame
from lfsr_core.frames.reference import Reference, check_reference
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.metrics.eia_metrics import METRIC_NAMES, compare
from lfsr_core.optics.eia import to_elemental_images
from lfsr_lab.experiments.engine.measures import lens_ssims

MAIN_METRICS = ("ssim_eia_fg", "ssim_lens_fg")  # of whole EIAs; of single lenses, which every reference has
Figures = dict[str, float | None]  # by the name of the metric; None where it cannot be known


@dataclasses.dataclass(frozen=True)
class Target:
    """A reference and the foreground that counts."""

    reference: Reference
    mask: Mask  # (sy, sx)

    @classmethod
    def read(cls, folder: Path, mask: Mask | None = None) -> Target:
        """Read a reference; ``mask`` (sy, sx) is the foreground where it shows only some lenses, else LfsrError."""
        reference = Reference.read(folder)
        if reference.lens_list is None:
            return cls(reference, reference.hits)
        if mask is None:
            raise LfsrError(f"{folder} shows only some lenses, so a low-resolution render must show which are "
                            "foreground, but there is none: run it without --only-measure")
        return cls(reference, reference.foreground_mask(mask))

    def check(self, frame: Frame) -> None:
        """LfsrError unless the reference shows what a frame shows."""
        check_reference(frame, self.reference.frame)

    @property
    def lenses(self) -> tuple[int, int]:
        """(sx, sy)."""
        return self.reference.frame.display.lenses

    @property
    def halves(self) -> tuple[Array, Array]:
        """Both halves of the reference, scene-linear."""
        return self.reference.half_a, self.reference.half_b

    def accuracy(self, image: Array, found: Mask | None = None) -> Figures:
        """Return every metric of an EIA, those of docs/reference/metrics.md.

        Parameters
        ----------
        image : (H, W, 3), scene-linear, in view order
        found : (sy, sx), the foreground that a render found, for its recall
        """
        reference = self.reference
        metrics: dict[str, Any] = compare(image, self.halves, self.lenses, self.mask, reference.lens_list)
        if reference.lens_list is None:
            metrics["recall"] = None if found is None else recall(found, self.mask)
        known = {name: metrics[name] for name in (*METRIC_NAMES, *metrics) if name in metrics}
        return {name: finite(value) for name, value in known.items() if name not in ("lenses", "notes", "ci95")}

    def lens_ssim(self, image: Array) -> Array:
        """Return the split SSIM (n,) of the reference's foreground lenses, each on its own."""
        shown = self.reference.foreground
        if not shown.any():
            return np.empty(0)
        rows, columns = self.reference.lenses[shown].T
        half_a, half_b = (half[shown] for half in self.reference.elemental_images())
        return lens_ssims(srgb_encode(to_elemental_images(image, self.lenses)[rows, columns]), half_a, half_b)


def split_rms(x: Array, a: Array, b: Array) -> float:
    """Return the root mean square error without the reference's noise, 0 where noise makes the square negative."""
    return root(float(np.mean((x - a) * (x - b), dtype=np.float64)))


def root(squared: float) -> float:
    """Return the square root of an unbiased squared error, 0 where noise made it negative."""
    return math.sqrt(max(squared, 0.0))


def finite(value: float | None) -> float | None:
    """Return a figure, None in place of infinity."""
    return value if value is not None and math.isfinite(value) else None
