"""EPICNN (Wu et al., TPAMI 2019): a network triples the rows of an epipolar-plane image.

The authors blur the views first and deblur them with a program of others afterwards; that is left out, which their
program allows (a kernel of one pixel).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as nn

from lfsr_core.base.arrays import Array
from lfsr_lab.experiments.rivals.layers import convolution, tensor, transposed
from lfsr_lab.experiments.rivals.matlab import from_ycbcr, resized, to_ycbcr
from lfsr_lab.experiments.rivals.weights import cells

RATIO = 3
CROP = 4  # rows and columns that the last layer makes beyond each end
BATCH = 64  # epipolar-plane images at a time


class EPICNN:
    """The network on the rows of a light field, then on its columns."""

    def __init__(self, clones: Path) -> None:
        self._layers = cells(clones, "lfepicnn/EPICNN/EPICNN_model.mat")

    def __call__(self, views: Array) -> Array:
        """Return views (3·(m - 1) + 1, 3·(n - 1) + 1, H, W, 3) of (m, n, H, W, 3), display values in [0, 1].

        One row or column of views is tripled along the other axis alone.
        """
        down = np.stack([self._tripled(column) for column in views.swapaxes(0, 1).swapaxes(2, 3)], 1).swapaxes(2, 3)
        return np.stack([self._tripled(row) for row in down])

    def _tripled(self, views: Array) -> Array:
        """Return views (3·(n - 1) + 1, H, W, 3) of (n, H, W, 3), which differ along W."""
        if len(views) == 1:
            return views
        planes = np.pad(to_ycbcr(views.astype(float)).swapaxes(0, 1), [(0, 0), (1, 1), (0, 0), (0, 0)], mode="edge")
        made = resized(planes, 1, RATIO * (planes.shape[1] - 1) + 1)
        made[..., 0] = np.concatenate([self._luma(planes[start:start + BATCH, ..., 0])
                                       for start in range(0, len(planes), BATCH)])
        return from_ycbcr(made[:, RATIO:-RATIO]).swapaxes(0, 1)

    @torch.inference_mode()
    def _luma(self, planes: Array) -> Array:
        x = tensor(planes)[:, None]
        for weight, bias in self._layers[:2]:
            x = nn.relu(convolution(x, weight, bias, 2))
        weight, bias = self._layers[2]
        return np.asarray(transposed(x, weight, bias, (RATIO, 1))[:, 0, CROP:-CROP, CROP:-CROP])
