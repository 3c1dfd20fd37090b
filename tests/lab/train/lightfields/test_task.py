"""Training our network on rendered scenes: it learns at all, resumes, and its file runs in the product."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from lfsr_core.files import read_json
from lfsr_core.reconstruct.networks import numpy_network, weights_file
from lfsr_lab.networks.lightfield import display_values, encode
from lfsr_lab.train import session
from lfsr_lab.train.config import from_values
from lfsr_lab.train.lightfields.data import load_scenes, make_batch, network_inputs
from lfsr_lab.train.lightfields.task import LightFieldTask, noise_darkening
from lfsr_lab.train.loop import RunOptions, Stop
from tests.support.training_scenes import write_scenes

TINY = {"network": "light", "width": 4, "body_width": 8, "blocks": 1, "epochs": 2, "steps_per_epoch": 20, "batch": 2}


@pytest.fixture
def folder(tmp_path):
    return write_scenes(tmp_path)


def test_the_curve_darkens_noise_as_much_as_is_added_back():
    torch.manual_seed(0)
    linear = torch.full((1, 3, 96, 96), 0.3)
    a, b = linear * (1 + 0.3 * torch.randn(2, 1, 3, 96, 96))
    curve = [display_values(encode(x)).mean() for x in (linear, a, b)]
    lost = curve[0] - (curve[1] + curve[2]) / 2
    assert noise_darkening(a, b).mean().item() == pytest.approx(lost.item(), rel=0.25)
    assert lost > 0.004


def test_training_learns_and_its_weights_run_in_the_product(folder, tmp_path):
    config = from_values({**TINY, "scenes": str(folder)}, "test")
    trained = session.train(config, tmp_path / "run", device="cpu")
    figures = trained.validation
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
