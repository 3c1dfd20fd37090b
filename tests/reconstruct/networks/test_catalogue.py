"""The networks: sizes, costs, scales, folding and the registry."""

from __future__ import annotations

import copy
import subprocess
import sys

import pytest
import torch
from torch import nn

from lfsr_core.errors import LfsrError
from lfsr_core.reconstruct.networks import catalogue
from lfsr_core.reconstruct.networks.pytorch.cost import multiply_adds, parameters
from lfsr_core.reconstruct.networks.pytorch.deconvolution import fold_for_inference
from lfsr_core.reconstruct.networks.pytorch.espcn import ESPCN
from lfsr_core.reconstruct.networks.pytorch.fsrcnn import FSRCNN
from lfsr_core.reconstruct.networks.pytorch.lightfield import LightFieldConfig, LightFieldNet
from lfsr_core.reconstruct.networks.pytorch.networks import build
from lfsr_core.reconstruct.networks.pytorch.paper import PaperGenerator
from lfsr_core.train.photographs.discriminator import Discriminator

torch.set_num_threads(2)
PHOTOGRAPH_NETWORKS = [name for name, entry in catalogue.NETWORKS.items()
                       if entry.upscaler == catalogue.PHOTOGRAPH_UPSCALER]
CLASSES = (PaperGenerator, FSRCNN, ESPCN)


@pytest.mark.parametrize("name", PHOTOGRAPH_NETWORKS)
@pytest.mark.parametrize("scale", [2, 3, 4, 8])
def test_every_network_upscales_by_its_scale(name, scale):
    high = build(name, scale)(torch.rand(2, 3, 7, 10))
    assert high.shape == (2, 3, 7 * scale, 10 * scale)


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


def test_discriminator_is_srgans():
    network = Discriminator()
    assert [layer.out_channels for layer in kinds(network, nn.Conv2d)] == [64, 64, 128, 128, 256, 256, 512, 512]
    assert [layer.stride[0] for layer in kinds(network, nn.Conv2d)] == [1, 2] * 4
    assert (len(kinds(network, nn.BatchNorm2d)), len(kinds(network, nn.Linear))) == (7, 2)
    assert network(torch.rand(2, 3, 96, 96)).shape == (2, 1)
    assert network(torch.rand(2, 3, 64, 80)).shape == (2, 1)


@pytest.mark.parametrize(("network", "expected"), [
    (PaperGenerator(4), 25 * 3 * 32 + 9 * 32 * 16 + 81 * 16 * 3),
    (FSRCNN(4), 25 * 3 * 56 + 56 * 12 + 4 * 9 * 12 * 12 + 12 * 56 + 81 * 56 * 3),
    (ESPCN(4), 25 * 3 * 64 + 9 * 64 * 32 + 9 * 32 * 48),
    (nn.Sequential(nn.Conv2d(3, 8, 3, padding=1, groups=1), nn.Conv2d(8, 8, 3, padding=1, groups=4)),
     9 * 3 * 8 + 9 * 8 * 2),
])
def test_multiply_adds_are_those_of_the_formula(network, expected):
    assert multiply_adds(network, 10, 6) == expected


@pytest.mark.parametrize("config", [LightFieldConfig(), LightFieldConfig(width=4, body_width=8, blocks=1)])
def test_multiply_adds_of_our_network_are_those_of_the_formula(config):
    width, body = config.width, config.body_width
    full = 9 * config.input_channels * width + 9 * width * config.outputs
    half = 4 * width * body + 2 * config.blocks * 9 * body * body + body * width * 4
    assert multiply_adds(LightFieldNet(config), 10, 6) == full + half / 4


def test_parameters_of_espcn():
    assert parameters(ESPCN(4)) == (75 + 1) * 64 + (576 + 1) * 32 + (288 + 1) * 48


@pytest.mark.parametrize("scale", [2, 3, 4, 8])
@pytest.mark.parametrize("network_class", CLASSES)
def test_folding_changes_nothing(network_class, scale):
    torch.manual_seed(3)
    network = network_class(scale)
    folded = fold_for_inference(copy.deepcopy(network))
    low = torch.rand(2, 3, 9, 6)
    assert not kinds(folded, nn.ConvTranspose2d)
    torch.testing.assert_close(folded(low), network(low), atol=1e-6, rtol=1e-5)


def test_zero_padding_is_the_default_and_replicate_keeps_a_flat_border():
    flat = torch.full((1, 3, 10, 10), 0.5)
    spread = {}
    for padding in ("zeros", "replicate"):
        torch.manual_seed(0)
        body = PaperGenerator(4, 2, padding).body(flat).detach()
        spread[padding] = float(body.std((2, 3)).max())
    assert spread["replicate"] < 1e-6
    assert spread["zeros"] > 1e-3


def test_unknown_network_names_the_nearest():
    with pytest.raises(LfsrError, match="did you mean 'fsrcnn'"):
        catalogue.spec("fsrcn")


def test_scale_that_does_not_fit():
    with pytest.raises(LfsrError, match="network 'paper' has no scale 5: choose one of 2, 3, 4, 8"):
        build("paper", 5)


def test_missing_package_is_one_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.delitem(sys.modules, "lfsr_core.reconstruct.networks.pytorch.upscalers", raising=False)
    monkeypatch.delitem(sys.modules, "lfsr_core.reconstruct.networks.pytorch.engine", raising=False)
    with pytest.raises(LfsrError, match=r"need the Python package 'torch'.*install lfsr\[training\]"):
        catalogue.upscaler("espcn")


def test_registry_and_contract_import_no_torch():
    code = ("import sys, lfsr_core, lfsr_core.reconstruct.registry, lfsr_core.reconstruct.networks.catalogue as n; "
            "assert n.NAMES and n.trained_scales('paper') is not None; "
            "sys.exit('torch' in sys.modules)")
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
