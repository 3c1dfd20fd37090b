"""The paper's generator: its layers and its border."""

from __future__ import annotations

import pytest
from torch import nn

from lfsr_core.errors import LfsrError
from lfsr_lab.networks.networks import build
from lfsr_lab.networks.paper import PaperGenerator


def kinds(network: nn.Module, kind: type) -> list[nn.Module]:
    return [layer for layer in network.modules() if isinstance(layer, kind)]


@pytest.mark.parametrize("convolutions", [2, 3, 4, 5, 6])
def test_paper_generator_has_the_papers_layers(convolutions):
    network = build("paper" if convolutions == 2 else f"paper-{convolutions}", 4)
    sizes = [(layer.in_channels, layer.out_channels, layer.kernel_size[0]) for layer in kinds(network, nn.Conv2d)]
    assert sizes == [(3, 32, 5), (32, 16, 3)] + [(16, 16, 3)] * (convolutions - 2)
    (up,) = kinds(network, nn.ConvTranspose2d)
    assert (up.in_channels, up.out_channels, up.kernel_size, up.stride) == (16, 3, (9, 9), (4, 4))


def test_paper_generator_refuses_other_depths():
    with pytest.raises(LfsrError, match="2 to 6 convolutions, not 7"):
        PaperGenerator(4, 7)
