"""The PyTorch twin against the library, with the library's own weights and with others."""

import itertools

import numpy as np
import pytest
import torch
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from lfsr_core.reconstruct.methods import denoise
from lfsr_core.reconstruct.methods.denoise import network_shapes
from lfsr_lab.networks import denoiser as twin
from lfsr_lab.networks.tza import BASE, SMALL, read_tza, write_tza
from tests.support.told import refuses

RANDOM = np.random.default_rng(0)


def render(shape):
    """A noisy render of stripes with highlights and black, albedo and normal; sides that are no multiple of 16."""
    columns = np.arange(shape[1])
    clean = np.where((columns // 9 % 2)[:, None], [3.0, 0.6, 0.2], [0.1, 0.1, 0.12]) * np.ones((shape[0], 1, 1))
    color = clean * RANDOM.gamma(2, 0.5, clean.shape)
    color[5:12, 20:25], color[30:33] = 300, 0
    normal = RANDOM.normal(0, 0.5, clean.shape)
    return tuple(image.astype(np.float32) for image in (color, np.clip(clean / 3, 0, 1), normal))


def noise(shape):
    """Random values as colour, albedo and normal."""
    return tuple(image.astype(np.float32) for image in (
        RANDOM.gamma(0.5, 4, (*shape, 3)), RANDOM.random((*shape, 3)), RANDOM.uniform(-1, 1, (*shape, 3))))


def by_twin(network, color, guides):
    color, *guides = (torch.from_numpy(image).permute(2, 0, 1)[None] for image in (color, *guides))
    seen = [guides[0], twin.normal_encode(guides[1])] if guides else []
    with torch.inference_mode():
        output = network(torch.cat([twin.hdr_encode(color), *seen], 1))
        output = twin.hdr_decode(output)
    return output[0].permute(1, 2, 0).numpy()


def by_library(path, color, guides):
    return denoise.denoise_image(color, *guides, weights=path.read_bytes(), input_scale=1.0)


@pytest.mark.parametrize(("images", "size", "name"), [*itertools.product((render, noise), twin.SIZES, twin.NAMES)])
def test_twin_equals_library(tmp_path, name, size, images):
    guided = name.endswith("guided")
    network = twin.Denoiser.from_tensors(twin.stock_weights(name, size), inputs=9 if guided else 3)
    write_tza(tmp_path / "some.tza", network.tensors())
    color, *guides = images((45, 70))
    guides = guides if guided else []
    ours, expected = (by(where, color, guides) for by, where in ((by_twin, network),
                                                                 (by_library, tmp_path / "some.tza")))
    np.testing.assert_allclose(ours, expected, rtol=1e-4, atol=1e-4)
    np.testing.assert_array_equal(expected, denoise.denoise_image(
        color, *guides, input_scale=1.0, quality="fast" if size == "small" else "balanced"),
        "the library's own weights, stored again")


@settings(max_examples=5, deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])  # to shrink is slow
@given(st.lists(st.integers(1, 24), min_size=15, max_size=15), st.booleans())
def test_any_widths_work(tmp_path_factory, widths, guided):
    torch.manual_seed(0)
    inputs, path = 9 if guided else 3, tmp_path_factory.mktemp("widths") / "some.tza"
    write_tza(path, twin.Denoiser((*widths, 3), inputs).tensors())
    stored = twin.Denoiser.from_tensors(read_tza(path), inputs)
    color, *guides = noise((20, 35))
    ours, expected = (by(where, color, guides if guided else [])
                      for by, where in ((by_twin, stored), (by_library, path)))
    np.testing.assert_allclose(ours, expected, rtol=1e-4, atol=1e-4)


@given(st.floats(0, 65504, width=32), st.sampled_from((0.25, 1.0, 8.0)))
def test_encoding_can_be_undone(value, scale):
    encoded = twin.hdr_encode(torch.tensor([value]), scale)
    assert 0 <= encoded <= 1 + 1e-6
    assert float(twin.hdr_decode(encoded, scale)) == pytest.approx(min(value, 65504 / scale), rel=2e-4, abs=1e-9)


def test_encoding_rises_and_has_gradients_and_the_twin_has_the_tensors_of_the_file():
    values = torch.cat([torch.zeros(1), torch.logspace(-8, 4.8, 400)]).requires_grad_()
    encoded = twin.hdr_encode(values)
    assert (encoded.diff() > 0).all()
    twin.hdr_decode(encoded).sum().backward()
    assert torch.isfinite(values.grad).all() and (values.grad > 0).all()
    for widths, inputs in ((BASE, 3), (SMALL, 9)):
        tensors = twin.Denoiser(widths, inputs).tensors()
        assert {name: value.shape for name, value in tensors.items()} == network_shapes(widths, inputs)


@pytest.mark.parametrize(("chosen", "message"), [(("albedo", "small"), "choose hdr"), (("hdr", "huge"), "choose hdr"),
                                                 ((), "install the package pyoidn")])
def test_stock_weights_that_there_are_not_are_one_sentence(monkeypatch, chosen, message):
    monkeypatch.setattr(denoise, "find_libraries", lambda: iter(()))
    refuses(message, twin.stock_weights, *chosen)
