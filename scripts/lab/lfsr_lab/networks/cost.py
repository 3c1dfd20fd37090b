"""Cost of a network: multiply-adds and parameters."""

from __future__ import annotations

import torch
from torch import nn
from torch.utils.flop_counter import FlopCounterMode


def parameters(network: nn.Module) -> int:
    """Number of trained values."""
    return sum(parameter.numel() for parameter in network.parameters())


def multiply_adds(network: nn.Module, h: int, w: int) -> float:
    """Count the multiply-adds per low-resolution pixel of one elemental image of h × w pixels by running the network.

    Convolutions, deconvolutions and linear layers count (padding included, as
    hardware multiplies it too); activations, additions and resampling do not.
    """
    like = next(network.parameters())
    with FlopCounterMode(display=False) as counter, torch.no_grad():
        network(like.new_zeros(1, 3, h, w))
    return counter.get_total_flops() / 2 / (h * w)  # torch counts the multiply and the add
