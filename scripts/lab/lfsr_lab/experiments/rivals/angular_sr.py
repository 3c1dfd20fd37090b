"""LightFieldAngularSR (Yeung et al., ECCV 2018): 8×8 views of 2×2, by convolutions over pixels and views in turn.

The stored network of L alternating pairs of layers makes 60 views from four, then refines them by convolutions with a
step of two views. It sees luma; chroma is interpolated linearly, as the authors do.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from lfsr_core.base.arrays import Array
from lfsr_lab.experiments.rivals.layers import convolution_4d, tensor
from lfsr_lab.experiments.rivals.matlab import from_ycbcr, linear, to_ycbcr
from lfsr_lab.experiments.rivals.weights import parameters

RATIO = 7
LEAK = 0.2
BAND, MARGIN = 128, 16  # rows at a time, and rows beside them that are seen too
CORNERS = np.array([0, 7, 56, 63])  # of 8×8 views, columns first as MATLAB counts
OTHERS = np.setdiff1d(np.arange(64), CORNERS)


class AngularSR:
    """The network of ``pairs`` alternating pairs; the weights of 4, 8 and 16 pairs are not in the stored copy."""

    def __init__(self, clones: Path, pairs: int = 2) -> None:
        self._layers = parameters(clones, f"LightFieldAngularSR/pretrained_models/Layer{pairs}.mat")
        self._pairs = pairs

    def __call__(self, corners: Array) -> Array:
        """Return views (8, 8, H, W, 3) of (2, 2, H, W, 3), display values in [0, 1]."""
        colour = to_ycbcr(corners)
        share = linear(np.arange(RATIO + 1)[:, None] / RATIO - np.arange(2))
        dense = np.einsum("ai,bj,ijhwc->abhwc", share, share, colour)
        luma = tensor(colour[..., 0])
        dense[..., 0] = np.concatenate([self._band(luma, start) for start in range(0, luma.shape[2], BAND)], 2)
        made = from_ycbcr(dense)
        made[::RATIO, ::RATIO] = corners
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
        made = convolution_4d(x, weight, self._layers[f"{name}_b{end}"], pad, step)
        return torch.nn.functional.leaky_relu(made, leak)


def _arranged(others: Tensor, corners: Tensor) -> Tensor:
    """Return (8, 8, H, W) of 60 new views and (2, 2, H, W), whose order is columns first."""
    whole = others.new_empty(64, *others.shape[1:])
    whole[OTHERS] = others
    whole[CORNERS] = corners.transpose(0, 1).flatten(0, 1)
    return whole.reshape(8, 8, *others.shape[1:]).transpose(0, 1)
