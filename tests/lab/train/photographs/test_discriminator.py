"""The discriminator's layers."""

from __future__ import annotations

import torch
from torch import nn

from lfsr_lab.train.photographs.task import Discriminator


def kinds(network: nn.Module, kind: type) -> list[nn.Module]:
    return [layer for layer in network.modules() if isinstance(layer, kind)]


def test_discriminator_is_srgans():
    network = Discriminator()
    assert [layer.out_channels for layer in kinds(network, nn.Conv2d)] == [64, 64, 128, 128, 256, 256, 512, 512]
    assert [layer.stride[0] for layer in kinds(network, nn.Conv2d)] == [1, 2] * 4
    assert (len(kinds(network, nn.BatchNorm2d)), len(kinds(network, nn.Linear))) == (7, 2)
    assert network(torch.rand(2, 3, 96, 96)).shape == (2, 1)
    assert network(torch.rand(2, 3, 64, 80)).shape == (2, 1)
