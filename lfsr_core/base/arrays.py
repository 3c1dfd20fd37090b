"""Arrays: types for annotations, beside which docstrings give shape, dtype and axes; and how gaps are filled."""

from collections.abc import Iterable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[Any]
Bytes: TypeAlias = NDArray[np.uint8]
Mask: TypeAlias = NDArray[np.bool_]


def spread(values: Array, reach: int, axes: Iterable[int], gap: float) -> Array:
    """Fill values of ``gap`` or more with the largest smaller one beside them along ``axes``, in ``reach`` steps."""
    for _ in range(reach):
        known = np.where(values < gap, values, np.float32(-gap))
        largest = known.copy()
        for axis in axes:
            here, there = np.moveaxis(largest, axis, 0), np.moveaxis(known, axis, 0)
            np.maximum(here[1:], there[:-1], out=here[1:])
            np.maximum(here[:-1], there[1:], out=here[:-1])
        values = np.where((values >= gap) & (largest > -gap), largest, values)
    return values
