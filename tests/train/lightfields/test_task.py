"""Our network and its training: exact where it must be, and learning at all."""

import json

import numpy as np
import pytest
import torch

from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.metrics.split_ssim import split_ssim_map as reference_ssim_map
from lfsr_core.reconstruct import encoding
from lfsr_core.reconstruct.methods import interpolation
from lfsr_core.reconstruct.networks import numpy_network, weights_file
from lfsr_core.reconstruct.networks.pytorch.lightfield import (
    LightFieldConfig,
    LightFieldNet,
    decode,
    display_values,
    encode,
    upscale,
)
from lfsr_core.train import session
from lfsr_core.train.config import from_values
from lfsr_core.train.lightfields import task as training
from lfsr_core.train.lightfields.data import from_eis, load_scene, load_scenes, make_batch, network_inputs, to_eis
from lfsr_core.train.lightfields.split_ssim import RADIUS, split_error_map, split_ssim_map
from lfsr_core.train.lightfields.task import LightFieldTask
from lfsr_core.train.loop import RunOptions, Stop

LENSES, VIEWS, SCALE = (8, 6), 16, 4


@pytest.fixture
def folder(tmp_path):
    """Three scenes of waves with exponential noise, as scripts/scenes/training_scenes.py stores them."""
    rng = np.random.default_rng(0)
    height, width = LENSES[1] * VIEWS, LENSES[0] * VIEWS
    y, x = np.mgrid[:height, :width]
    for index in range(3):
        image = np.stack([0.5 + 0.4 * np.sin(x / 9 + index + c) * np.cos(y / 11) for c in range(3)], -1)
        low = image.reshape(height // SCALE, SCALE, width // SCALE, SCALE, 3).mean((1, 3))
        noisy = low * rng.exponential(1, low.shape)
        normal = np.broadcast_to([1.0, 0.0, 0.0], low.shape)
        layers = np.concatenate([noisy, np.ones_like(low[..., :1]), low * 3, normal], -1)
        halves = {f"ref_{half}": np.concatenate([image * rng.normal(1, 0.02, image.shape), image[..., :1] * 0 + 1], -1)
                  for half in "ab"}
        denoised = {f"{kind}_4": low * rng.normal(1, 0.2, low.shape) for kind in ("oidn", "guided")}
        arrays = {"lr_4": layers, **denoised, **halves}
        meta = json.dumps({"spps": [4], "lenses": LENSES})
        np.savez(tmp_path / f"scene_{index}.npz", meta=meta, **{k: v.astype(np.float16) for k, v in arrays.items()})
    return tmp_path


def test_working_domain_is_that_of_the_second_stage():
    linear = torch.linspace(0, 60, 5001)
    assert torch.allclose(decode(encode(linear)), linear, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(encode(linear)[1:].numpy(), encoding.encode(linear[1:].numpy()), atol=1e-6)
    assert encode(linear[:1]).item() == pytest.approx(1e-4)  # the floor that keeps its slope finite


def test_losses_see_what_metrics_see():
    encoded = torch.linspace(-0.5, 3, 4001)
    expected = srgb_encode(decode(encoded).numpy())
    np.testing.assert_allclose(display_values(encoded).numpy(), expected, atol=1e-5)


def test_untrained_network_gives_its_base_back():
    net = LightFieldNet(LightFieldConfig())
    base = torch.rand(LENSES[0] * LENSES[1], 3, 10, 10)
    assert torch.equal(net(torch.rand(len(base), net.config.input_channels, 10, 10), base), base)


@pytest.mark.parametrize("scale", [2, 3, 4, 8])
def test_upscaling_in_training_is_the_method_bilinear(scale):
    low = np.random.default_rng(0).random((5, 10, 10, 3)).astype(np.float32)
    expected = np.empty((5, 10 * scale, 10 * scale, 3), np.float32)
    interpolation.interpolate(low.copy(), "linear", scale, expected)
    ours = decode(upscale(torch.from_numpy(low.transpose(0, 3, 1, 2)), scale))
    np.testing.assert_allclose(ours.numpy().transpose(0, 2, 3, 1), expected, atol=1e-5)


def test_training_ssim_is_the_one_that_is_reported():
    rng = np.random.default_rng(1)
    x, a, b = (rng.random((40, 48, 3)).astype(np.float32) for _ in range(3))
    planes = [torch.from_numpy(v.transpose(2, 0, 1))[None] for v in (x, a, b)]
    ours = split_ssim_map(*planes)[0].mean(0).numpy()
    theirs = reference_ssim_map(x, a, b)
    theirs = theirs.mean(-1) if theirs.ndim == 3 else theirs
    inside = (slice(RADIUS, -RADIUS),) * 2
    assert np.abs(ours[inside] - theirs[inside]).max() < 1e-4


def test_loss_of_noisy_halves_is_lowest_at_the_truth():
    """The gradient of the loss must not ask for sharper or softer images because the reference is noisy."""
    rng = np.random.default_rng(2)
    y, x = np.mgrid[:64, :96]
    truth = 0.5 + 0.1 * np.sin(x / 3) * np.cos(y / 4)

    def loss(image, noise):
        planes = [torch.from_numpy(v.astype(np.float32))[None, None] for v in (
            image, *(truth + rng.normal(0, noise, truth.shape) for _ in range(2)), 0.5 + 0.9 * (truth - 0.5))]
        return split_error_map(*planes).mean().item()

    for noise in (0.001, 0.05, 0.1):
        losses = {gain: np.mean([loss(0.5 + gain * (truth - 0.5), noise) for _ in range(40)])
                  for gain in (0.8, 1.0, 1.25)}
        assert losses[1.0] == min(losses.values()), noise
        assert losses[1.0] == pytest.approx(0, abs=0.02)


def test_the_curve_darkens_noise_as_much_as_is_added_back():
    torch.manual_seed(0)
    linear = torch.full((1, 3, 96, 96), 0.3)
    a, b = linear * (1 + 0.3 * torch.randn(2, 1, 3, 96, 96))
    curve = [display_values(encode(x)).mean() for x in (linear, a, b)]
    lost = curve[0] - (curve[1] + curve[2]) / 2
    assert training.noise_darkening(a, b).mean().item() == pytest.approx(lost.item(), rel=0.25)
    assert lost > 0.004


def test_elemental_images_and_back():
    image = torch.rand(2, 3, LENSES[1] * 5, LENSES[0] * 7)
    assert torch.equal(from_eis(to_eis(image, LENSES), LENSES), image)


def test_albedo_of_emitters_is_limited(folder):
    assert load_scene(folder / "scene_0.npz").low[4][4:7].max() == 1


def test_augmentation_keeps_input_and_reference_the_same_light_field(folder):
    scenes = load_scenes(folder)
    for seed in range(12):
        batch = make_batch(scenes[:1], 4, "cpu", np.random.default_rng(seed))
        low = from_eis(batch.layers["oidn"], batch.lenses)
        high = torch.nn.functional.avg_pool2d(batch.halves.mean(1), SCALE)
        assert torch.corrcoef(torch.stack([low.flatten(), high.flatten()]))[0, 1] > 0.85
        assert torch.allclose(batch.layers["normal"].norm(dim=1), torch.ones(()), atol=1e-3)


def test_inputs_have_the_channels_that_the_network_expects(folder):
    batch = make_batch(load_scenes(folder)[:1], 4)
    config = LightFieldConfig(inputs=("oidn", "guided", "color", "alpha", "albedo", "normal"), base="oidn")
    features, base = network_inputs(batch.layers, 4, config)
    assert features.shape[1] == config.input_channels
    assert torch.equal(base, features[:, :3])


def test_second_base_is_mixed_in():
    torch.manual_seed(0)
    config = LightFieldConfig(inputs=("oidn", "color", "guided"), base="oidn", second_base="guided", width=4,
                              body_width=4)
    network, features = LightFieldNet(config), torch.rand(3, config.input_channels, 6, 6)
    for share, expected in ((0.0, features[:, :3]), (1.0, features[:, 6:9]), (0.25, None)):
        network.out.bias.data[4] = share
        expected = 0.75 * features[:, :3] + 0.25 * features[:, 6:9] if expected is None else expected
        assert torch.allclose(network(features, features[:, :3]), expected, atol=1e-6)


TINY = {"network": "light", "width": 4, "body_width": 8, "blocks": 1, "epochs": 2, "steps_per_epoch": 20, "batch": 2}


def test_training_learns_and_its_weights_run_in_the_product(folder, tmp_path):
    config = from_values({**TINY, "scenes": str(folder)}, "test")
    trained = session.train(config, tmp_path / "run", device="cpu")
    figures = trained.outcome.validation
    untrained = LightFieldTask(config, load_scenes(folder), torch.device("cpu")).validate()
    assert figures["light.eia_4"] < 0.9 * untrained["light.eia_4"]
    facts = read_json(trained.weights.with_suffix(".json"), "provenance")
    assert facts["data"]["scenes"] == 3 and facts["validation"] == figures
    network = numpy_network.load(trained.weights)
    batch = make_batch(load_scenes(folder)[:1], 4)
    features, base = network_inputs(batch.layers, 4, config.architecture)
    clean = network(*(x.permute(0, 2, 3, 1).contiguous().numpy() for x in (features, base)))
    assert np.abs(clean - base.permute(0, 2, 3, 1).numpy()).max() > 0.05


def test_a_stopped_training_resumes_to_the_same_weights(folder, tmp_path):
    config = from_values({**TINY, "scenes": str(folder)}, "test")
    whole = session.train(config, tmp_path / "whole", device="cpu")
    stop = Stop()

    def interrupt(_stage, fraction, _message):
        stop.asked = fraction >= 0.6

    cut = session.train(config, tmp_path / "cut", "cpu", RunOptions(progress=interrupt, stop=stop))
    assert cut.weights is None
    resumed = session.train(config, tmp_path / "cut", "cpu", RunOptions(resume=True))
    tensors, expected = (weights_file.read(run.weights)[1] for run in (resumed, whole))
    assert weights_file.digest(tensors) == weights_file.digest(expected)


def test_wrong_training_input_is_told(tmp_path):
    with pytest.raises(LfsrError, match="no training scenes"):
        load_scenes(tmp_path)
    (tmp_path / "scene.npz").write_bytes(b"not a scene")
    with pytest.raises(LfsrError, match="cannot be read as a training scene"):
        load_scenes(tmp_path)
    with pytest.raises(LfsrError, match="no 'scenes'"):
        from_values({"network": "light"}, "test")
    with pytest.raises(LfsrError, match="did you mean 'steps_per_epoch'"):
        from_values({"network": "light", "scenes": "x", "steps_epoch": 3}, "test")


def test_ablations_change_the_architecture():
    config = from_values({"network": "refine", "scenes": "x", "without": "albedo,normal", "blocks": 2}, "test")
    assert config.architecture.inputs == ("oidn", "guided", "color", "alpha") and config.architecture.blocks == 2
    alone = from_values({"network": "refine", "scenes": "x", "without": "guided"}, "test").architecture
    assert alone.inputs == ("oidn", "color", "alpha", "albedo", "normal") and not alone.second_base
    shipped = from_values({"network": "refine", "scenes": "x"}, "test").architecture
    assert shipped.inputs == ("oidn", "guided", "color", "alpha", "albedo", "normal") and shipped.blocks == 1
    assert shipped.second_base == "guided"
