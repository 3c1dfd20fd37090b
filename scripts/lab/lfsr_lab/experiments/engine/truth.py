"""What elemental images are compared with: the lenses of a reference that count, and renders finished for them."""

from __future__ import annotations

import dataclasses
from functools import cached_property
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.foreground import foreground_mask
from lfsr_core.frames.frame import LOW_RES_FILE, read_frame
from lfsr_core.frames.low_res import low_resolution, read_world
from lfsr_core.frames.reference import Reference
from lfsr_core.images.exr import clean, read_layers
from lfsr_core.reconstruct.second_stage import finished_lenses
from lfsr_lab.networks.methods import ready


@dataclasses.dataclass(frozen=True)
class Truth:
    """A reference, of all lenses or of some."""

    folder: Path

    @cached_property
    def reference(self) -> Reference:
        """The reference, read when first asked for."""
        return Reference.read(self.folder)

    @cached_property
    def counted(self) -> Array:
        """(n,) bool: the reference's lenses that count; all of the block where views differ along one axis."""
        one_axis = not all(self.reference.frame.display.parallax)
        return self.reference.foreground | one_axis

    @cached_property
    def lenses(self) -> Array:
        """(n, 2) rows and columns of the lenses that count."""
        return self.reference.lenses[self.counted]

    @cached_property
    def halves(self) -> tuple[Array, Array]:
        """Both halves, scene-linear, as ``shown``."""
        a, b = (self.shown(images[self.counted]) for images in self.reference.linear_images())
        return a, b

    def shown(self, images: Array) -> Array:
        """Return elemental images (n, py, px, 3) as they are compared; decoded views of a block of lenses."""
        if all(self.reference.frame.display.parallax):
            return images
        rows = len(np.unique(self.lenses[:, 0]))
        block = images.reshape(rows, -1, images.shape[1] * images.shape[2], 3)
        return np.ascontiguousarray(np.moveaxis(block, 2, 0))

    def finished(self, render: Path, finish: Finish | str) -> Array:
        """Finish the lenses that count of a render, as ``shown``, scene-linear; nothing is written."""
        layers, frame = clean(read_layers(render / LOW_RES_FILE))[0], read_frame(render)
        low = low_resolution(layers, frame, read_world(render, frame))
        rows, columns = self.lenses.T
        mask = foreground_mask(layers, frame.rays.tiles)[rows, columns]
        finish, upscaler = ready(finish) if isinstance(finish, str) else (finish, None)
        return self.shown(finished_lenses(low, mask, finish, self.lenses, upscaler=upscaler))
