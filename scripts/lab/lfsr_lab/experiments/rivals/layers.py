"""Layers of MatConvNet in PyTorch: stored filters are (H, W, in, out), of two more axes where views are convolved."""

from __future__ import annotations

import torch
import torch.nn.functional as nn
from torch import Tensor

from lfsr_core.base.arrays import Array


def tensor(values: Array) -> Tensor:
    """Return a float32 tensor of an array."""
    return torch.tensor(values, dtype=torch.float32)


def convolution(x: Tensor, weight: Array, bias: Array, pad: int) -> Tensor:
    """Convolve (N, in, H, W) with filters (h, w, in, out)."""
    return nn.conv2d(x, tensor(weight).permute(3, 2, 0, 1), tensor(bias), padding=pad)


def transposed(x: Tensor, weight: Array, bias: Array, step: tuple[int, int]) -> Tensor:
    """Return the transposed convolution of (N, in, H, W), uncropped, with filters (h, w, out, in)."""
    return nn.conv_transpose2d(x, tensor(weight).permute(3, 2, 0, 1), tensor(bias), stride=step)


def convolution_4d(x: Tensor, weight: Array, bias: Array, pad: tuple[int, int], step: int = 1) -> Tensor:
    """Convolve a light field over pixels and views.

    Parameters
    ----------
    x : (rows of views, columns of views, in, H, W)
    weight : (h, w, rows, columns, in, out)
    pad : of pixels and of views, with zeros on every side
    step : of views
    """
    filters = tensor(weight).permute(5, 2, 3, 4, 0, 1)
    rows, columns = filters.shape[1:3]
    x = nn.pad(x, (0, 0, 0, 0, 0, 0, pad[1], pad[1], pad[1], pad[1]))
    flat = filters.flatten(1, 3)
    made = [[nn.conv2d(x[v:v + rows, u:u + columns].flatten(0, 2)[None], flat, tensor(bias).ravel(), padding=pad[0])[0]
             for u in range(0, x.shape[1] - columns + 1, step)] for v in range(0, x.shape[0] - rows + 1, step)]
    return torch.stack([torch.stack(row) for row in made])
