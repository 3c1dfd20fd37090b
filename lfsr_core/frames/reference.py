"""References: the full-resolution EIA that others are measured against, as two independent halves."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array, Mask
from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.folder import first_difference, phrases
from lfsr_core.frames.frame import REFERENCE_FILES, Frame, read_frame
from lfsr_core.frames.low_res import foreground_mask, over_background
from lfsr_core.images.color import srgb_encode
from lfsr_core.images.exr import read_finite
from lfsr_core.optics.eia import to_elemental_images

SAME_AS_REFERENCE = ("display", "convention", "frame", "world_visible", "light")
MOST_NAME = 60  # characters of a scene's name in a message


@dataclasses.dataclass(frozen=True)
class Reference:
    """A reference folder in memory."""

    folder: Path  # that it was read from
    frame: Frame  # how it was rendered
    # half_a, half_b: (H, W, 3) scene-linear over the background; all lenses, or side by side those of the list
    half_a: Array
    half_b: Array
    hits: Mask  # (rows, columns) bool, the tiles where either half shows foreground

    @classmethod
    def read(cls, folder: str | Path) -> Reference:
        """Read a reference; LfsrError where a file is missing or of another size, or both halves are the same."""
        folder = Path(folder)
        frame = read_frame(folder)
        (half_a, hits_a), (half_b, hits_b) = (read_half(folder / name, frame) for name in REFERENCE_FILES)
        if half_a.any() and np.array_equal(half_a, half_b):
            raise LfsrError(f"both halves in {folder} are the same image, so neither shows the other's noise: "
                            "render the reference again with this version")
        return cls(folder, frame, half_a, half_b, hits_a | hits_b)

    @property
    def lens_list(self) -> tuple[tuple[int, int], ...] | None:
        """(row, column) of the lenses it shows, None for all."""
        return self.frame.lens_list

    @property
    def lenses(self) -> Array:
        """(n, 2) rows and columns of the lenses it shows, in the order of its tiles."""
        sx, sy = self.frame.display.lenses
        return np.argwhere(np.ones((sy, sx), bool)) if self.lens_list is None else np.array(self.lens_list)

    @property
    def foreground(self) -> Mask:
        """(n,) bool: which of ``lenses`` show foreground."""
        return self.hits.reshape(-1)[:len(self.lenses)]

    def linear_images(self) -> tuple[Array, Array]:
        """Return both halves as scene-linear elemental images (n, py, px, 3), in the order of ``lenses``."""
        return listed_images(self.half_a, self.frame), listed_images(self.half_b, self.frame)

    def elemental_images(self) -> tuple[Array, Array]:
        """Return both halves as sRGB values in [0, 1], (n, py, px, 3), in the order of ``lenses``."""
        half_a, half_b = self.linear_images()
        return srgb_encode(half_a), srgb_encode(half_b)

    def foreground_mask(self, low_resolution: Mask) -> Mask:
        """Return its own foreground (sy, sx) if it shows every lens, else that of a ``low_resolution`` render."""
        return self.hits if self.lens_list is None else low_resolution


def listed_images(pixels: Array, frame: Frame) -> Array:
    """Return the elemental images (n, py, px, 3) of the lenses in a render (H, W, 3), without spare tiles."""
    images = to_elemental_images(pixels, frame.rays.tiles)
    count = images.shape[0] * images.shape[1] if frame.lens_list is None else len(frame.lens_list)
    return images.reshape(-1, *images.shape[2:])[:count]


def read_half(path: Path, frame: Frame) -> tuple[Array, Mask]:
    """Read one half of a reference: (H, W, 3) scene-linear over its background, and its foreground (rows, columns).

    LfsrError where the file is missing or of another size than ``frame``.
    """
    layers = read_finite(path)[0]
    return over_background(layers, frame, str(path)), foreground_mask(layers, frame.rays.tiles)


def check_reference(frame: Frame, reference: Frame) -> None:
    """LfsrError unless ``reference`` shows at full resolution what ``frame`` shows."""
    if reference.scale != 1:
        raise LfsrError(f"the reference has scale {reference.scale}, but it must be 1: render it with 'lfsr reference'")
    wanted = {name: vars(frame)[name] for name in SAME_AS_REFERENCE}
    # Older folders do not know their light.
    wanted["light"] = wanted["light"] if reference.light and frame.light else reference.light
    if name := first_difference(vars(reference), wanted):
        theirs, ours = phrases(name, vars(reference)[name], vars(frame)[name])
        raise LfsrError(f"the reference was rendered with {theirs}, but the frame with {ours}: "
                        "render the reference of the same frame in the same way")
    ours_at, theirs_at = ([*vars(of.array).values(), *np.ravel(of.matrix_world)] for of in (frame, reference))
    if not np.allclose(ours_at, theirs_at, rtol=1e-5, atol=1e-5 * frame.array.distance):
        if frame.scene != reference.scene:
            theirs, ours = (of.scene[:MOST_NAME] or "one without a name" for of in (reference, frame))
            raise LfsrError(f"the reference shows another scene, {theirs}, but the frame {ours}: compare with the "
                            "reference of the same scene")
        distances = [of.array.distance for of in (reference, frame)]
        where = (f"its display plane is {distances[0]:.4g} from the cameras, the frame's {distances[1]:.4g}"
                 if not math.isclose(*distances, rel_tol=1e-5) else
                 "its cameras stand or face elsewhere, as with another camera or subject")
        raise LfsrError(f"the reference does not show what the frame shows: {where}. Render both of the same scene "
                        "in the same way")
    if frame.lens_list is not None and frame.lens_list != reference.lens_list:
        raise LfsrError(f"the reference shows other lenses than the {len(frame.lens_list)} of the frame: "
                        "render it for the same list")
