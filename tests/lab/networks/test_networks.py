"""Comparators, built."""

from __future__ import annotations

import pytest
import torch
from torch import nn

from lfsr_core.base.errors import LfsrError
from lfsr_lab.networks import comparators
from lfsr_lab.networks.networks import PaperGenerator, build

PHOTOGRAPH_NETWORKS = [name for name, entry in comparators.NETWORKS.items()
                       if not entry.whole]


@pytest.mark.parametrize("name", PHOTOGRAPH_NETWORKS)
@pytest.mark.parametrize("scale", [2, 3, 4, 8])
def test_every_network_upscales_by_its_scale(name, scale):
    high = build(name, scale)(torch.rand(2, 3, 7, 10))
    assert high.shape == (2, 3, 7 * scale, 10 * scale)


def test_unknown_network_names_the_nearest():
    with pytest.raises(LfsrError, match="did you mean 'fsrcnn'"):
        comparators.spec("fsrcn")


def test_scale_that_does_not_fit():
    with pytest.raises(LfsrError, match="network 'paper' has no scale 5: choose one of 2, 3, 4, 8"):
        build("paper", 5)


@pytest.mark.parametrize("convolutions", [2, 3, 4, 5, 6])
def test_paper_generator_has_the_papers_layers(convolutions):
    network = build("paper" if convolutions == 2 else f"paper-{convolutions}", 4)
    sizes = [(layer.in_channels, layer.out_channels, layer.kernel_size[0]) for layer in network.modules()
             if isinstance(layer, nn.Conv2d)]
    assert sizes == [(3, 32, 5), (32, 16, 3)] + [(16, 16, 3)] * (convolutions - 2)
    up = network.up
    assert (up.in_channels, up.out_channels, up.kernel_size, up.stride) == (16, 3, (9, 9), (4, 4))


def test_paper_generator_refuses_other_depths():
    with pytest.raises(LfsrError, match="2 to 6 convolutions, not 7"):
        PaperGenerator(4, 7)
