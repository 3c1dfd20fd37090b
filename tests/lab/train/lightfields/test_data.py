"""Rendered scenes as batches: cut, augmented and fed to the network."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from lfsr_core.errors import LfsrError
from lfsr_lab.networks.lightfield import LightFieldConfig
from lfsr_lab.train.lightfields.data import from_eis, load_scene, load_scenes, make_batch, network_inputs, to_eis
from tests.support.training_scenes import LENSES, SCALE, write_scenes


@pytest.fixture
def folder(tmp_path):
    return write_scenes(tmp_path)


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


def test_what_is_no_scene_is_named(tmp_path):
    with pytest.raises(LfsrError, match="no training scenes"):
        load_scenes(tmp_path)
    (tmp_path / "scene.npz").write_bytes(b"not a scene")
    with pytest.raises(LfsrError, match="cannot be read as a training scene"):
        load_scenes(tmp_path)
