"""Our networks in NumPy: the arithmetic of the torch module, routing, fallback, and every wrong file."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
import torch

from lfsr_core.errors import LfsrError
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct.encoding import decode, encode
from lfsr_core.reconstruct.networks import catalogue, numpy_network, weights_file
from lfsr_core.reconstruct.networks.elemental import ElementalUpscaler, needs_network
from lfsr_core.reconstruct.networks.numpy_network import ElementalNetwork, network_inputs
from lfsr_core.reconstruct.registry import method
from lfsr_lab.networks import checkpoint, lightfield
from lfsr_lab.networks.networks import build
from lfsr_lab.train.lightfields.data import network_inputs as training_inputs

GRID, SIDE = (3, 4), 6
LENSES = np.array([(0, 0), (2, 3), (1, 1), (0, 2), (2, 0)])


def random_network(name="refine", seed=0):
    """Torch module with every tensor random."""
    torch.manual_seed(seed)
    net = build(name, 4)
    for value in net.parameters():
        torch.nn.init.normal_(value, std=0.2)
    return net.eval()


@pytest.fixture
def low():
    rng = np.random.default_rng(0)

    def image(channels, top=1.0):
        return rng.uniform(0, top, (*GRID, SIDE, SIDE, channels)).astype(np.float32)

    aux = {"albedo": image(3, 1.5), "normal": image(3) - 0.5, "noisy": image(3, 3), "guided": image(3, 2)}
    return LowResEIA(image(3, 2), image(1), 16, 4, **aux)


@pytest.fixture
def file(tmp_path):
    """Weights of a random ``refine``."""
    path = tmp_path / "refine-x4.safetensors"
    checkpoint.save(path, random_network(), 4, {}, catalogue.spec("refine").options)
    return path


@pytest.mark.parametrize("name", ["refine", "light"])
def test_what_ships_is_the_network_of_the_catalogue(name):
    header, _ = weights_file.read(catalogue.weights_path(name, 4))
    options = json.loads(header["options"])
    assert {**options, "inputs": tuple(options["inputs"])} == catalogue.spec(name).options


@pytest.mark.parametrize("name", ["refine", "light"])
@pytest.mark.parametrize("side", [4, 5])
def test_arithmetic_is_that_of_the_trained_module(name, side):
    net = random_network(name)
    features = torch.rand(7, net.config.input_channels, side, side)
    with torch.no_grad():
        expected = net(features, features[:, 1:4]).permute(0, 2, 3, 1).numpy()
    tensors = {key: value.numpy() for key, value in net.state_dict().items()}
    channels_last = np.ascontiguousarray(features.permute(0, 2, 3, 1).numpy())
    result = ElementalNetwork(tensors, catalogue.spec(name).options, "here")(channels_last, channels_last[..., 1:4])
    np.testing.assert_allclose(result, expected, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize("name", ["refine", "light"])
def test_inputs_are_those_of_training(low, name):
    net = random_network(name)
    ours = ElementalNetwork({k: v.numpy() for k, v in net.state_dict().items()}, catalogue.spec(name).options, "here")
    features, base = network_inputs(ours, low, LENSES)

    def planes(values):
        return torch.from_numpy(np.ascontiguousarray(values[LENSES[:, 0], LENSES[:, 1]].transpose(0, 3, 1, 2)))

    noisy = low.noisy if name == "refine" else low.color
    layers = {"oidn": planes(low.color), "color": planes(noisy), "alpha": planes(low.alpha),
              "guided": planes(low.guided), "albedo": planes(np.minimum(low.albedo, 1)),
              "normal": planes(low.normal)}
    expected, expected_base = training_inputs(layers, 16, net.config)
    np.testing.assert_allclose(features, expected.permute(0, 2, 3, 1).numpy(), atol=1e-6)
    np.testing.assert_allclose(base, expected_base.permute(0, 2, 3, 1).numpy(), atol=1e-6)


def test_each_elemental_image_is_on_its_own(low, file):
    upscaler = ElementalUpscaler("refine", weights=file)
    together = upscaler(low, LENSES)
    assert together.shape == (5, SIDE * 4, SIDE * 4, 3) and together.dtype == np.float32 and together.min() >= 0
    for index, lens in enumerate(LENSES):
        np.testing.assert_allclose(upscaler(low, lens[None])[0], together[index], rtol=1e-5, atol=1e-6)
    noise = np.random.default_rng(1).random(low.color.shape).astype(np.float32)
    noise[1, 1] = low.color[1, 1]
    np.testing.assert_allclose(upscaler(dataclasses.replace(low, color=noise), LENSES)[2], together[2], rtol=1e-5,
                               atol=1e-6)


@pytest.mark.parametrize("scale", [2, 3, 8])
def test_one_set_of_weights_serves_every_scale(low, file, scale):
    low = dataclasses.replace(low, scale=scale)
    assert ElementalUpscaler("refine", weights=file)(low, LENSES).shape == (5, SIDE * scale, SIDE * scale, 3)


def test_flat_elemental_images_need_no_network(low, file):
    color = low.color.copy()
    color[0, 0] = 0.25
    low, upscaler = dataclasses.replace(low, color=color), ElementalUpscaler("refine", weights=file)
    result = upscaler(low, LENSES)
    np.testing.assert_allclose(result[0], 0.25, atol=1e-6)
    assert upscaler.notes == []
    everywhere = ElementalUpscaler("refine", weights=file, flat=-1)(low, LENSES)
    # Other batches, other sums: a BLAS may round them differently.
    np.testing.assert_allclose(everywhere[1:], result[1:], rtol=1e-4)
    assert np.abs(everywhere[0] - result[0]).max() > 1e-3


def test_each_elemental_image_keeps_the_light_it_was_rendered_with(low, file):
    checkpoint.save(file, build("refine", 4), 4, {}, catalogue.spec("refine").options)
    rendered = low.color * np.random.default_rng(3).uniform(0.9, 1.1, (*GRID, 1, 1, 3)).astype(np.float32)
    low = dataclasses.replace(low, noisy=rendered)
    kept = decode(ElementalUpscaler("refine", weights=file, flat=-1).clean(low, LENSES)).mean((1, 2))
    np.testing.assert_allclose(kept, rendered[LENSES[:, 0], LENSES[:, 1]].mean((1, 2)), rtol=1e-3)


def test_light_is_kept_as_in_training():
    rng = np.random.default_rng(4)
    encoded, light = (rng.uniform(0, 1.5, shape).astype(np.float32) for shape in ((5, 6, 7, 3), (5, 1, 1, 3)))
    planes = [torch.from_numpy(np.ascontiguousarray(v.transpose(0, 3, 1, 2))) for v in (encoded, light)]
    expected = lightfield.conserve(*planes).permute(0, 2, 3, 1).numpy()
    np.testing.assert_allclose(numpy_network.conserve(encoded, light), expected, rtol=1e-4, atol=2e-4)
    assert np.isfinite(numpy_network.conserve(np.zeros((1, 4, 4, 3), np.float32), light[:1])).all()


def test_flatness_is_judged_per_channel():
    images = np.zeros((3, 4, 4, 3), np.float32)
    images[1, 2, 2, 1] = 0.05
    images[2] = [0.1, 0.5, 0.9]
    assert needs_network(images, 0.02).tolist() == [False, True, False]


def test_missing_layers_fall_back_and_say_so(low, file):
    bare = dataclasses.replace(low, albedo=None, normal=None, guided=None)
    upscaler = ElementalUpscaler("refine", weights=file)
    np.testing.assert_array_equal(upscaler(bare, LENSES), method("bilinear").upscaler(bare, LENSES))
    assert "needs the layers albedo, normal," in upscaler.notes[0] and "linearly instead" in upscaler.notes[0]


def test_one_image_stands_for_both(low, file):
    upscaler = ElementalUpscaler("refine", weights=file)
    alone, twice = dataclasses.replace(low, guided=None), dataclasses.replace(low, guided=low.color)
    np.testing.assert_array_equal(upscaler(alone, LENSES), upscaler(twice, LENSES))
    for before in catalogue.spec("refine").after:
        assert method(f"{before}+refine").name.upscaler == "refine"


def test_refine_without_denoiser_is_refused():
    with pytest.raises(LfsrError, match=r"use 'oidn-both\+refine'"):
        method("refine")


def test_weights_written_again_are_read_again(file):
    before = numpy_network.load(file)
    assert numpy_network.load(file) is before
    checkpoint.save(file, random_network(seed=1), 4, {}, catalogue.spec("refine").options)
    assert numpy_network.load(file) is not before


def test_wrong_files_are_told(tmp_path, file):
    with pytest.raises(LfsrError, match="does not exist"):
        numpy_network.load(tmp_path / "no.safetensors")
    other = tmp_path / "other.safetensors"
    checkpoint.save(other, build("paper", 4), 4, {}, {"convolutions": 2})
    with pytest.raises(LfsrError, match="expected 'LightFieldNet'"):
        numpy_network.load(other)
    checkpoint.save(other, random_network(), 4, {}, {**catalogue.spec("refine").options, "width": 12})
    with pytest.raises(LfsrError, match=r"'stem' of shape \(8, 17, 3, 3\), expected \(12, 17, 3, 3\)"):
        numpy_network.load(other)
    checkpoint.save(other, random_network(), 4, {}, {**catalogue.spec("refine").options, "spatial": True})
    with pytest.raises(LfsrError, match="across lenses"):
        numpy_network.load(other)
    for change, message in (({"blocks": 10**9}, "blocks, 1000000000, at most 64"),
                            ({"base": "sky"}, "among the inputs"),
                            ({"plain": 2.0}, "'plain' is 2.0, expected 0 to 1"),
                            ({"width": "8"}, "width is '8'"), ({"depth": 3}, "unknown field 'depth'")):
        checkpoint.save(other, random_network(), 4, {}, {**catalogue.spec("refine").options, **change})
        with pytest.raises(LfsrError, match=message):
            numpy_network.load(other)
    file.write_bytes(file.read_bytes()[:-40])
    with pytest.raises(LfsrError, match="cannot be read as safetensors"):
        numpy_network.load(file)


def rendered_images(samples, count=40, size=5, seed=0):
    """EIs (N, h, w, 3) of a gradient with a dark part, noise-free and with that of so many samples."""
    random = np.random.default_rng(seed)
    exact = np.linspace(0.02, 0.9, size)[None, None, :, None] * random.uniform(0.2, 1, (count, 1, 1, 3))
    exact = np.broadcast_to(exact, (count, size, size, 3)).astype(np.float32)
    noisy = exact * random.gamma(samples, 1 / samples, exact.shape).astype(np.float32)
    return exact, noisy


def light_after(rendered, exact):
    """Mean light of EIs that a network restored exactly, once they have the light that was rendered."""
    encoded = encode(exact)
    light = numpy_network.steady_light(rendered, encoded)
    return numpy_network.mean_light(decode(numpy_network.conserve(encoded, light)))


@pytest.mark.parametrize("samples", [4, 16, 64])
@pytest.mark.parametrize("value", [10.0, 50.0, 1e4])
def test_firefly_moves_the_light_of_its_image_by_less_than_two_percent(samples, value):
    exact, noisy = rendered_images(samples)
    noisy[:, 2, 1] = exact[:, 2, 1]
    flash = noisy.copy()
    flash[:, 2, 1] = value
    without, found = light_after(noisy, exact), light_after(flash, exact)
    assert np.abs(found / without - 1).max() < 0.02
    plain = numpy_network.mean_light(decode(numpy_network.conserve(encode(exact), numpy_network.mean_light(flash))))
    assert (plain / without).min() > 1.2, "the plain mean flashes"


def test_images_without_fireflies_keep_the_light_they_were_rendered_with():
    for samples in (4, 16, 10_000):
        exact, noisy = rendered_images(samples, count=400)
        light = numpy_network.steady_light(noisy, encode(exact))
        np.testing.assert_allclose(light, numpy_network.mean_light(noisy), rtol=1e-5)
    spark = exact.copy()
    spark[:, 3, 3] = 20.0
    light = numpy_network.steady_light(spark, encode(spark))
    np.testing.assert_allclose(light, numpy_network.mean_light(spark), rtol=1e-5, err_msg="seen by the network too")
