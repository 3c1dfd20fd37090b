"""What a network costs: multiply-adds and parameters."""

from __future__ import annotations

import torch
from torch import Tensor, nn


def parameters(network: nn.Module) -> int:
    """Number of trained values."""
    return sum(parameter.numel() for parameter in network.parameters())


def multiply_adds(network: nn.Module, h: int, w: int, *inputs: object) -> float:
    """Multiply-adds per low-resolution pixel for one (3, h, w) image, counted by running it.

    Convolutions, deconvolutions and linear layers count (padding included, as
    hardware multiplies it too); activations, additions and resampling do not.
    ``inputs`` replaces the default (1, 3, h, w) zeros for networks with others.
    """
    total = 0

    def count(layer: nn.Module, arguments: tuple[Tensor, ...], output: Tensor) -> None:
        nonlocal total
        total += layer_multiply_adds(layer, arguments[0], output)

    kinds = (nn.Conv2d, nn.ConvTranspose2d, nn.Linear)
    hooks = [layer.register_forward_hook(count) for layer in network.modules() if isinstance(layer, kinds)]
    try:
        with torch.no_grad():
            network(*(inputs or (_zeros(network, h, w),)))
    finally:
        for hook in hooks:
            hook.remove()
    return total / (h * w)


def _zeros(network: nn.Module, h: int, w: int) -> Tensor:
    return next(network.parameters()).new_zeros(1, 3, h, w)


def layer_multiply_adds(layer: nn.Module, x: Tensor, y: Tensor) -> int:
    """Multiply-adds of one convolution, deconvolution or linear layer from input ``x`` to output ``y``."""
    if isinstance(layer, nn.ConvTranspose2d):
        return x.numel() * layer.weight[0].numel()
    return y.numel() * layer.weight[0].numel()
