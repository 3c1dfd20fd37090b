"""The engine computes the network's values, in any step."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.low_res import LowResEIA
from lfsr_lab.networks import upscalers
from lfsr_lab.networks.networks import PaperGenerator
from lfsr_lab.networks.upscalers import Engine, PhotographUpscaler, WholeEIAUpscaler, srgb_decode, srgb_encode

torch.set_num_threads(2)


@pytest.fixture
def network():
    torch.manual_seed(5)
    made = PaperGenerator(2).eval().requires_grad_(False)
    torch.nn.init.constant_(made.up.bias, 0.4)
    return made


def low_images(count=7, h=6, w=5):
    return np.random.default_rng(2).random((count, h, w, 3), dtype=np.float32) * 1.4


def expected(network, linear):
    encoded = srgb_encode(torch.from_numpy(linear)).permute(0, 3, 1, 2)
    return srgb_decode(network(encoded).clamp(0, 1)).permute(0, 2, 3, 1).numpy()


@pytest.mark.parametrize("step", [1, 3, 7, 50, None])
def test_engine_agrees_with_the_network_for_every_step(network, step):
    result = Engine(network, device="cpu", step=step)(low_images())
    assert result.dtype == np.float32 and result.shape == (7, 12, 10, 3)
    np.testing.assert_allclose(result, expected(network, low_images()), atol=2e-5)


@pytest.mark.parametrize(("settings", "message"), [
    ({"step": 0}, "step is 0"),
    ({"device": "tpu"}, "device is 'tpu'"),
])
def test_bad_settings(network, settings, message):
    with pytest.raises(LfsrError, match=message):
        Engine(network, **settings)


@pytest.mark.skipif(torch.cuda.is_available(), reason="says what happens without CUDA")
def test_absent_gpu(network):
    with pytest.raises(LfsrError, match="'cuda' is not available"):
        Engine(network, device="cuda")


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs CUDA")
@pytest.mark.parametrize("step", [3, 64])
def test_cuda_is_near_and_stays_on_the_device(network, step):
    run = Engine(network, device="cuda", step=step)
    result = run.run(torch.from_numpy(low_images()).cuda())
    assert result.is_cuda
    np.testing.assert_allclose(result.cpu().numpy(), expected(network, low_images()), atol=5e-3)


def low_eia(sy=4, sx=5, h=6, w=5, aux=(), seed=0):
    color = np.random.default_rng(seed).random((sy, sx, h, w, 3), dtype=np.float32)
    layers = {name: np.zeros_like(color) for name in aux}
    return LowResEIA(color, np.ones((sy, sx, h, w, 1), np.float32), 16, 2, **layers)


@pytest.fixture
def paper_weights(network, monkeypatch):
    monkeypatch.setattr(upscalers, "load", lambda name, scale, weights=None: network)
    return network


def test_upscaler_gives_the_lenses_asked_for(paper_weights):
    low, lenses = low_eia(), np.array([[3, 1], [0, 0], [2, 4]])
    result = PhotographUpscaler("paper", device="cpu")(low, lenses)
    np.testing.assert_allclose(result, expected(paper_weights, low.color[lenses[:, 0], lenses[:, 1]]), atol=2e-5)
    assert PhotographUpscaler("paper")(low, np.zeros((0, 2), int)).shape == (0, 12, 10, 3)


@pytest.mark.parametrize("rows_at_once", [1, 2, 8])
def test_whole_eia_is_one_image_whatever_the_strips(paper_weights, rows_at_once, monkeypatch):
    monkeypatch.setattr(upscalers, "ROWS_AT_ONCE", rows_at_once)
    low = low_eia()
    image = low.color.transpose(0, 2, 1, 3, 4).reshape(1, 4 * 6, 5 * 5, 3)
    whole = expected(paper_weights, image)[0].reshape(4, 12, 5, 10, 3)
    lenses = np.array([[0, 0], [1, 3], [3, 4], [2, 2], [1, 0]])
    result = WholeEIAUpscaler("paper-eia", device="cpu")(low, lenses)
    np.testing.assert_allclose(result, np.stack([whole[row, :, column] for row, column in lenses]), atol=2e-5)


def test_whole_eia_keeps_rows_of_the_same_frame_only(paper_weights):
    upscaler, lenses = WholeEIAUpscaler("paper-eia", device="cpu"), np.array([[1, 1]])
    first, second = upscaler(low_eia(seed=1), lenses), upscaler(low_eia(seed=2), lenses)
    assert np.abs(first - second).max() > 0.01


def test_nan_is_replaced_and_noted(paper_weights):
    low, lenses = low_eia(), np.array([[0, 0], [1, 1]])
    low.color[1, 1, 2, 2, 0] = np.nan
    low.color[0, 0, 0, 0, 1] = np.inf
    upscaler = PhotographUpscaler("paper", device="cpu")
    with pytest.warns(UserWarning, match="NaN or infinite"):
        result = upscaler(low, lenses)
    low.color[1, 1, 2, 2, 0] = low.color[0, 0, 0, 0, 1] = 0
    np.testing.assert_array_equal(result, upscaler(low, lenses))
    assert len(upscaler.notes) == 1
