"""A slow chain of colour transforms as a shaper and one 3D table, if the table shows the same colours.

Looks take up to ten times as long as their view alone. Sampled on a grid that is even in log light, with tetrahedral
interpolation, all of Blender's views take equally long. OpenColorIO evaluates both.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import PyOpenColorIO as ocio

from lfsr_core.base.arrays import Array

# The table spans scene-linear light from 0 to BRIGHTEST, even in log2(light + 2^STOPS[0]).
STOPS, GRID = (-7.0, 3.0), 97
BRIGHTEST = 2.0**STOPS[1] - 2.0**STOPS[0]
# Accuracy that a table must have on TRIED random colours: the largest error in steps of 255, the largest fraction of
# colours with that error (so small that none is expected beyond), and the smallest fraction within one step.
MAX_STEPS, MAX_FRACTION, MIN_WITHIN_ONE, TRIED = 3, 1e-4, 0.999, 1 << 17
THREADS = 4

Apply = Callable[[Array], Array]


def bake(to_float: Apply, to_bytes: Apply) -> ocio.CPUProcessor | None:
    """Return a table from scene-linear floats to bytes, or None if it would show other colours.

    ``to_float``, ``to_bytes``: the exact chain, (..., W, 3) scene-linear to display values.
    """
    low, width = STOPS[0], STOPS[1] - STOPS[0]
    shaper = ocio.LogAffineTransform(logSideSlope=[1 / width] * 3, logSideOffset=[-low / width] * 3,
                                     linSideSlope=[1.0] * 3, linSideOffset=[2.0**low] * 3)
    table = ocio.GroupTransform([shaper, _table(to_float)])
    processor = ocio.Config.CreateRaw().getProcessor(table).getOptimizedCPUProcessor(
        ocio.BIT_DEPTH_F32, ocio.BIT_DEPTH_UINT8, ocio.OPTIMIZATION_DEFAULT)
    colors = _random_colors()
    baked = np.empty(colors.shape, np.uint8)
    processor.apply(ocio.PackedImageDesc(colors, TRIED, 1, 3),
                    ocio.PackedImageDesc(baked, TRIED, 1, 3, ocio.BIT_DEPTH_UINT8, 1, 3, 3 * TRIED))
    steps = np.abs(baked.astype(np.int16) - to_bytes(colors)).max(-1)
    return processor if _is_accurate(steps) else None


def _is_accurate(steps: Array) -> bool:
    """Whether a table with errors of ``steps`` of 255 can replace its chain."""
    few = np.mean(steps >= MAX_STEPS) <= MAX_FRACTION
    return bool(steps.max() <= MAX_STEPS and few and np.mean(steps <= 1) >= MIN_WITHIN_ONE)


def _table(to_float: Apply) -> ocio.Lut3DTransform:
    low, high = STOPS
    light = (2 ** np.linspace(low, high, GRID) - 2.0**low).astype(np.float32)

    def slab(red: np.float32) -> Array:
        """Display values (green, blue, 3) for one red."""
        colors = np.empty((GRID, GRID, 3), np.float32)
        colors[..., 0], colors[..., 1], colors[..., 2] = red, light[:, None], light
        return to_float(colors)

    with ThreadPoolExecutor(THREADS) as pool:
        values = np.stack(list(pool.map(slab, light)))
    table = ocio.Lut3DTransform(gridSize=GRID)
    table.setInterpolation(ocio.INTERP_TETRAHEDRAL)
    table.setData(values.ravel())
    return table


def _random_colors() -> Array:
    """(1, TRIED, 3) scene-linear colours of every lightness and saturation, always the same.

    Half of them lack one primary: there tables fail first.
    """
    random = np.random.default_rng(0)
    stops = random.uniform(STOPS[0] - 4, STOPS[1], (1, TRIED, 1)) + random.normal(0, 1.2, (1, TRIED, 3))
    colors = np.minimum(2**stops, BRIGHTEST).astype(np.float32)
    half = np.arange(0, TRIED, 2)
    colors[0, half, random.integers(0, 3, half.size)] = 0
    return colors
