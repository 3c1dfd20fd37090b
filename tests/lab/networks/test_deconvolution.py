"""Deconvolutions folded for inference."""

from __future__ import annotations

import copy

import pytest
import torch
from torch import nn

from lfsr_lab.networks.networks import ESPCN, FSRCNN, PaperGenerator, fold_for_inference


@pytest.mark.parametrize("scale", [2, 3, 4, 8])
@pytest.mark.parametrize("network_class", [PaperGenerator, FSRCNN, ESPCN])
def test_folding_changes_nothing(network_class, scale):
    torch.manual_seed(3)
    network = network_class(scale)
    folded = fold_for_inference(copy.deepcopy(network))
    low = torch.rand(2, 3, 9, 6)
    assert not any(isinstance(layer, nn.ConvTranspose2d) for layer in folded.modules())
    torch.testing.assert_close(folded(low), network(low), atol=1e-6, rtol=1e-5)
