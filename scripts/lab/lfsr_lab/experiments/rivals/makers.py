"""What makes the views between low-resolution views, by name: networks of others, in the hull of the views given."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_lab.experiments.rivals.angular_sr import RATIO as ANGULAR_RATIO
from lfsr_lab.experiments.rivals.angular_sr import AngularSR
from lfsr_lab.experiments.rivals.epicnn import EPICNN
from lfsr_lab.experiments.rivals.epicnn import RATIO as EPICNN_RATIO
from lfsr_lab.experiments.rivals.sheared_epi import ShearedEPI

Make = Callable[[Array], Array]  # views (m, n, H, W, 3) to (r·(m - 1) + 1, r·(n - 1) + 1, H, W, 3)


@dataclasses.dataclass(frozen=True)
class Maker:
    """A network."""

    ratio: int | None  # steps between two given views; None for any
    load: Callable[[Path, int, int], Make]  # from the folder of clones, the ratio, and the greatest shear in pixels

    def makes(self, ratio: int) -> bool:
        """Whether it can divide the step between views by ``ratio``."""
        return self.ratio in (ratio, None)


def _angular(pairs: int) -> Maker:
    return Maker(ANGULAR_RATIO, lambda clones, ratio, _: lambda views: of_cells(views, ratio, AngularSR(clones, pairs)))


MAKERS = {
    "AngularSR-1": _angular(1),
    "AngularSR-2": _angular(2),
    "Sheared-EPI": Maker(None, lambda clones, ratio, most: lambda views: of_cells(
        views, ratio, lambda corners: ShearedEPI(clones, most)(corners, ratio))),
    "EPICNN": Maker(EPICNN_RATIO, lambda clones, *_: EPICNN(clones)),
}


def of_cells(views: Array, ratio: int, make: Make) -> Array:
    """Return views made by a network that takes 2×2, cell by cell; those that two cells share are their means."""
    rows, columns = (ratio * (count - 1) + 1 for count in views.shape[:2])
    total = np.zeros((rows, columns, *views.shape[2:]), np.float32)
    count = np.zeros((rows, columns, 1, 1, 1), np.float32)
    for row, column in np.ndindex(views.shape[0] - 1, views.shape[1] - 1):
        part = slice(row * ratio, (row + 1) * ratio + 1), slice(column * ratio, (column + 1) * ratio + 1)
        total[part] += make(views[row:row + 2, column:column + 2])
        count[part] += 1
    return total / count
