"""The weave: from the finished EIA, a regular light field, to the image of a panel with a lens sheet."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.cores import usable_cores
from lfsr_core.base.errors import LfsrError
from lfsr_core.optics.panel.gather import MAX_WORKERS, ONE, GatherMap

AT_ONCE = 1 << 17  # subpixels: their data fit into a core's cache


def weave(eia: Array, mapped: GatherMap) -> Array:
    """Return the panel's image (H, W, 3) uint8 of a finished EIA (rows, columns, 3) uint8 in view order.

    ``mapped``: gather map of the display. LfsrError if the EIA is not of the size and type that the map needs.
    """
    columns, rows = mapped.eia_pixels
    if eia.shape != (rows, columns, 3) or eia.dtype != np.uint8:
        raise LfsrError(f"the EIA has shape {eia.shape} of {eia.dtype}, but the weave needs ({rows}, {columns}, 3) of "
                        "uint8: upscale the folder again")
    # Samples beyond the last byte have a weight of 0, but are read.
    source = np.zeros(eia.size + sum(axis.stride for axis in mapped.axes), np.uint8)
    source[:eia.size] = eia.reshape(-1)
    result = np.empty(mapped.first.shape, np.uint8)
    first, shown = mapped.first.reshape(-1), result.reshape(-1)
    axes = [(axis.stride, axis.weights.reshape(-1)) for axis in mapped.axes]

    def work(start: int) -> None:
        part = slice(start, start + AT_ONCE)
        # ``take`` is fastest with NumPy's own index type.
        index, mixed = first[part].astype(np.intp), [(stride, weights[part]) for stride, weights in axes]
        shown[part] = _mixed(source, index, mixed)

    with ThreadPoolExecutor(min(usable_cores(), MAX_WORKERS)) as pool:
        list(pool.map(work, range(0, first.size, AT_ONCE)))
    return result


def _mixed(source: Array, index: Array, axes: list[tuple[int, Array]]) -> Array:
    """Values at ``index``, interpolated along every axis (stride, weights), the last one outermost."""
    if not axes:
        return source.take(index)
    *inner, (stride, weights) = axes
    here = _mixed(source, index, inner)
    # The next samples lie one stride further.
    difference = _mixed(source[stride:], index, inner).astype(np.int16)
    difference -= here
    difference *= weights
    difference += ONE // 2
    difference >>= 7
    difference += here
    return difference.astype(np.uint8)
