"""What makes the views between low-resolution views, by name: networks of others, in the hull of the views given."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as nn
from torch import Tensor

from lfsr_core.base.arrays import Array
from lfsr_lab.experiments.rivals import matlab
from lfsr_lab.experiments.rivals.sheared_epi import ShearedEPI

ANGULAR_RATIO = 7
LEAK = 0.2
BAND, MARGIN = 128, 16  # rows at a time, and rows beside them that are seen too
CORNERS = np.array([0, 7, 56, 63])  # of 8×8 views, columns first as MATLAB counts
OTHERS = np.setdiff1d(np.arange(64), CORNERS)


class AngularSR:
    """The network of ``pairs`` alternating pairs; the weights of 4, 8 and 16 pairs are not in the stored copy."""

    def __init__(self, clones: Path, pairs: int = 2) -> None:
        self._layers = matlab.parameters(clones, f"LightFieldAngularSR/pretrained_models/Layer{pairs}.mat")
        self._pairs = pairs

    def __call__(self, corners: Array) -> Array:
        """Return views (8, 8, H, W, 3) of (2, 2, H, W, 3), display values in [0, 1]."""
        colour = matlab.to_ycbcr(corners)
        share = matlab.linear(np.arange(ANGULAR_RATIO + 1)[:, None] / ANGULAR_RATIO - np.arange(2))
        dense = np.einsum("ai,bj,ijhwc->abhwc", share, share, colour)
        luma = matlab.tensor(colour[..., 0])
        dense[..., 0] = np.concatenate([self._band(luma, start) for start in range(0, luma.shape[2], BAND)], 2)
        made = matlab.from_ycbcr(dense)
        made[::ANGULAR_RATIO, ::ANGULAR_RATIO] = corners
        return made

    def _band(self, luma: Tensor, start: int) -> Array:
        before = min(start, MARGIN)
        made = self.luma(luma[:, :, start - before:start + BAND + MARGIN])
        return np.asarray(made[:, :, before:before + min(BAND, luma.shape[2] - start)])

    @torch.inference_mode()
    def luma(self, corners: Tensor) -> Tensor:
        """Return luma (8, 8, H, W) of (2, 2, H, W)."""
        convolve, x = self._convolve, corners[:, :, None]
        features = convolve(x, "pre_level1_conv6d", (1, 1))
        for pair in range(1, self._pairs + 1):
            features = convolve(features, f"level{pair}_conv6d", (1, 0), "_mid")
            features = convolve(features, f"level{pair}_conv6d", (0, 1), "_mid2")
        coarse = convolve(features, "level1_conv6d", (1, 0), leak=1.0)[0, 0]
        fine = convolve(_arranged(coarse, corners)[:, :, None], "pre_level1_conv6d", (1, 0), "_2", step=2)
        fine = convolve(fine, "level1_conv6d", (1, 0), "_post", step=2)
        return _arranged(coarse + convolve(fine, "level1_conv6d", (1, 0), "_post2", leak=1.0)[0, 0], corners)

    def _convolve(self, x: Tensor, name: str, pad: tuple[int, int], end: str = "", step: int = 1,
                  leak: float = LEAK) -> Tensor:
        weight = self._layers[f"{name}_f{end}"]
        weight = weight.reshape(*weight.shape, *[1] * (6 - weight.ndim))
        made = matlab.convolution_4d(x, weight, self._layers[f"{name}_b{end}"], pad, step)
        return torch.nn.functional.leaky_relu(made, leak)


def _arranged(others: Tensor, corners: Tensor) -> Tensor:
    """Return (8, 8, H, W) of 60 new views and (2, 2, H, W), whose order is columns first."""
    whole = others.new_empty(64, *others.shape[1:])
    whole[OTHERS] = others
    whole[CORNERS] = corners.transpose(0, 1).flatten(0, 1)
    return whole.reshape(8, 8, *others.shape[1:]).transpose(0, 1)


EPICNN_RATIO = 3
CROP = 4  # rows and columns that the last layer makes beyond each end
BATCH = 64  # epipolar-plane images at a time


class EPICNN:
    """The network on the rows of a light field, then on its columns."""

    def __init__(self, clones: Path) -> None:
        self._layers = matlab.cells(clones, "lfepicnn/EPICNN/EPICNN_model.mat")

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
        luma = matlab.to_ycbcr(views.astype(float)).swapaxes(0, 1)
        planes = np.pad(luma, [(0, 0), (1, 1), (0, 0), (0, 0)], mode="edge")
        made = matlab.resized(planes, 1, EPICNN_RATIO * (planes.shape[1] - 1) + 1)
        made[..., 0] = np.concatenate([self._luma(planes[start:start + BATCH, ..., 0])
                                       for start in range(0, len(planes), BATCH)])
        return matlab.from_ycbcr(made[:, EPICNN_RATIO:-EPICNN_RATIO]).swapaxes(0, 1)

    @torch.inference_mode()
    def _luma(self, planes: Array) -> Array:
        x = matlab.tensor(planes)[:, None]
        for weight, bias in self._layers[:2]:
            x = nn.relu(matlab.convolution(x, weight, bias, 2))
        weight, bias = self._layers[2]
        return np.asarray(matlab.transposed(x, weight, bias, (EPICNN_RATIO, 1))[:, 0, CROP:-CROP, CROP:-CROP])


Make = Callable[[Array], Array]  # views (m, n, H, W, 3) to (r·(m - 1) + 1, r·(n - 1) + 1, H, W, 3)


@dataclasses.dataclass(frozen=True)
class Maker:
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
