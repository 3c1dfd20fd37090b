"""One ray per pixel."""

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.optics.rays import RayLayout, rays


def pixel_rays(layout: RayLayout, place: tuple[float, float] = (0.5, 0.5)) -> tuple[Array, Array]:
    """Origins and unit directions, (H, W, 3), of one ray per pixel, rows from the top.

    ``place``: where in the pixel, (rightwards, downwards) in [0, 1).
    """
    width, height = layout.size
    raster_x, raster_y = np.meshgrid((np.arange(width) + place[0]) / width,
                                     1 - (np.arange(height) + place[1]) / height)
    return rays(layout, raster_x, raster_y)
