"""Networks of the catalogue, built."""

from __future__ import annotations

import pytest
import torch

from lfsr_core.errors import LfsrError
from lfsr_core.reconstruct.networks import catalogue
from lfsr_lab.networks import comparators
from lfsr_lab.networks.networks import build

PHOTOGRAPH_NETWORKS = [name for name, entry in catalogue.NETWORKS.items()
                       if entry.upscaler == comparators.PER_IMAGE]


@pytest.mark.parametrize("name", PHOTOGRAPH_NETWORKS)
@pytest.mark.parametrize("scale", [2, 3, 4, 8])
def test_every_network_upscales_by_its_scale(name, scale):
    high = build(name, scale)(torch.rand(2, 3, 7, 10))
    assert high.shape == (2, 3, 7 * scale, 10 * scale)


def test_scale_that_does_not_fit():
    with pytest.raises(LfsrError, match="network 'paper' has no scale 5: choose one of 2, 3, 4, 8"):
        build("paper", 5)
