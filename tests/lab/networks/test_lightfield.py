"""Our network in PyTorch: its working domain, its upscaling and what it gives back untrained."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from lfsr_core.images.srgb import srgb_decode, srgb_encode
from lfsr_core.reconstruct import encoding
from lfsr_core.reconstruct.methods import interpolation
from lfsr_lab.networks import srgb
from lfsr_lab.networks.lightfield import (
    LightFieldConfig,
    LightFieldNet,
    decode,
    display_values,
    encode,
    upscale,
)


def test_working_domain_is_that_of_the_second_stage():
    linear = torch.linspace(0, 60, 5001)
    assert torch.allclose(decode(encode(linear)), linear, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(encode(linear)[1:].numpy(), encoding.encode(linear[1:].numpy()), atol=1e-6)
    assert encode(linear[:1]).item() == pytest.approx(1e-4)  # the floor that keeps its slope finite


def test_tensors_and_arrays_go_through_the_same_curve():
    values = np.linspace(-0.5, 1.5, 1001, dtype=np.float32)
    np.testing.assert_allclose(srgb.srgb_encode(torch.from_numpy(values)).numpy(), srgb_encode(values), atol=1e-6)
    np.testing.assert_allclose(srgb.srgb_decode(torch.from_numpy(values)).numpy(), srgb_decode(values), atol=1e-6)


def test_display_values_are_what_metrics_see():
    encoded = torch.linspace(-0.5, 3, 4001)
    expected = srgb_encode(decode(encoded).numpy())
    np.testing.assert_allclose(display_values(encoded).numpy(), expected, atol=1e-5)


def test_untrained_network_gives_its_base_back():
    net = LightFieldNet(LightFieldConfig())
    base = torch.rand(48, 3, 10, 10)
    assert torch.equal(net(torch.rand(len(base), net.config.input_channels, 10, 10), base), base)


def test_a_share_of_the_result_is_the_plain_mean_of_both_bases():
    net = LightFieldNet(LightFieldConfig(("oidn", "guided"), "oidn", "guided", plain=0.3))
    features = torch.rand(48, net.config.input_channels, 10, 10)
    base, second = features[:, :3], features[:, 3:6]
    torch.testing.assert_close(net(features, base), 0.85 * base + 0.15 * second)


@pytest.mark.parametrize("scale", [2, 3, 4, 8])
def test_upscaling_in_training_is_the_method_bilinear(scale):
    low = np.random.default_rng(0).random((5, 10, 10, 3)).astype(np.float32)
    expected = encoding.decode(interpolation.interpolated(low.copy(), "linear", (scale, scale)))
    ours = decode(upscale(torch.from_numpy(low.transpose(0, 3, 1, 2)), scale))
    np.testing.assert_allclose(ours.numpy().transpose(0, 2, 3, 1), expected, atol=1e-5)


def test_second_base_is_mixed_in():
    torch.manual_seed(0)
    config = LightFieldConfig(inputs=("oidn", "color", "guided"), base="oidn", second_base="guided", width=4,
                              body_width=4)
    network, features = LightFieldNet(config), torch.rand(3, config.input_channels, 6, 6)
    for fraction, expected in ((0.0, features[:, :3]), (1.0, features[:, 6:9]), (0.25, None)):
        network.out.bias.data[4] = fraction
        expected = 0.75 * features[:, :3] + 0.25 * features[:, 6:9] if expected is None else expected
        assert torch.allclose(network(features, features[:, :3]), expected, atol=1e-6)
