"""Comparators trained on photographs: crops, the paper's losses, and training from config to weights."""

import dataclasses
import json
import os

import cv2
import numpy as np
import pytest
import torch
from torch import nn

from lfsr_core.base.messages import LfsrError
from lfsr_core.cli import main
from lfsr_lab.networks import checkpoint
from lfsr_lab.networks.networks import load
from lfsr_lab.networks.upscalers import srgb_decode
from lfsr_lab.train import loop
from lfsr_lab.train.loop import read_log
from lfsr_lab.train.photographs import task as comparator
from lfsr_lab.train.session import train
from tests.support.told import refuses
from tests.support.training_photographs import small, some_photographs, write_photographs

# The photographs are tiny: a second thread would only wait for the first.
torch.set_num_threads(1)
CPU = torch.device("cpu")


@pytest.fixture
def folder(tmp_path):
    return write_photographs(tmp_path / "photographs")


def test_a_folder_is_read_pixel_by_pixel_reduction_keeps_the_mean_and_the_digest_sees_all(folder):
    images, read = some_photographs().images, comparator.load_photographs(folder).images
    assert [image.tolist() for image in read] == [image.tolist() for image in images]
    reduced = comparator.load_photographs(folder, long_side=26).images
    assert [max(image.shape) for image in reduced] == [26, 26, 26]
    for one, image in zip(reduced, images, strict=True):
        np.testing.assert_allclose(one.mean((0, 1)), image.mean((0, 1)), atol=3)
    one, other = some_photographs(), some_photographs(seed=1)
    assert len({one.digest, other.digest, comparator.Photographs(("a.png", *one.names[1:]), one.images).digest}) == 3


@pytest.mark.parametrize(("write", "message"), [(lambda folder: None, "holds no photographs"),
    (lambda folder: (folder / "a.jpg").write_bytes(b"not an image"), "as a photograph .*: remove it or get it again"),
    (lambda folder: os.mkfifo(folder / "a.png"), r"a\.png .*not a regular file"),
    (lambda folder: comparator.CropSampler(some_photographs(), 64, 2, 0, CPU), "0.png is smaller than a crop of 64")])
def test_bad_photographs(tmp_path, write, message):
    with pytest.raises(LfsrError, match=message):
        write(tmp_path)
        comparator.load_photographs(tmp_path)


def crops(seed=7, epoch=0):
    sampler = comparator.CropSampler(some_photographs(), 16, 40, seed, CPU)
    sampler.begin(epoch, 4)
    return sampler


def test_crops_are_seeded_parts_of_their_photographs_turned_in_every_way():
    windows = {window.tobytes() for image in some_photographs().images for row in
               np.lib.stride_tricks.sliding_window_view(image, (16, 16), (0, 1)) for window in row}
    turns = [(axes, order) for order in ((0, 1, 2), (0, 2, 1)) for axes in ((), (1,), (2,), (1, 2))]
    batches = list(crops())
    assert len(batches) == 30 and batches[0].shape == (4, 3, 16, 16)
    seen = set()
    for batch in batches:
        ways = [{index for index, (axes, order) in enumerate(turns)
                 if np.flip(crop, axes).transpose(order).tobytes() in windows}
                for crop in (batch * 255).round().byte().numpy()]
        assert all(ways)
        seen |= set.intersection(*ways)
    assert seen == set(range(8))
    first = crops(1, 5)[0]
    assert torch.equal(first, crops(1, 5)[0])
    assert not torch.equal(first, crops(1, 6)[0]) and not torch.equal(first, crops(2, 5)[0])


def test_downsampling_is_the_mean_light_and_quality_agrees_with_scikit_image():
    from skimage.metrics import peak_signal_noise_ratio, structural_similarity
    high = torch.rand(2, 3, 8, 12)
    mean = srgb_decode(high).reshape(2, 3, 2, 4, 3, 4).mean((3, 5))
    torch.testing.assert_close(srgb_decode(comparator.downsample(high, 4)), mean, atol=1e-5, rtol=1e-4)
    random = np.random.default_rng(1)
    a = cv2.GaussianBlur(random.random((50, 60, 3)), (0, 0), 2).astype(np.float64)
    b = (a + random.normal(0, 0.05, a.shape)).clip(0, 1)
    tensors = [torch.from_numpy(image).permute(2, 0, 1)[None] for image in (b, a)]
    assert float(comparator.psnr(*tensors)) == pytest.approx(peak_signal_noise_ratio(a, b, data_range=1), abs=1e-6)
    expected = structural_similarity(a, b, data_range=1, channel_axis=2, gaussian_weights=True, sigma=1.5,
                                     use_sample_covariance=False, win_size=11)
    assert float(comparator.ssim(*tensors)) == pytest.approx(expected, abs=1e-6)


class Judge(nn.Module):
    """Logit = ten times the mean."""

    def forward(self, images):
        return 10 * images.mean((1, 2, 3))[:, None]


def task_of(config):
    return comparator.ComparatorTask(config, comparator.load_photographs(config.photographs), None, CPU)


def test_cosine_schedule_falls_from_the_rate_to_zero(folder, monkeypatch):
    rates = []
    monkeypatch.setattr(torch.optim.Adam, "step", lambda adam: rates.append(adam.param_groups[0]["lr"]))
    task = task_of(small(folder, schedule="cosine", epochs=4))
    for epoch in range(4):
        task.begin(epoch)
        task.step(0)
    assert rates == pytest.approx([1e-3, 0.8536e-3, 0.5e-3, 0.1464e-3], rel=1e-3)


def test_an_adversary_learns_changes_the_generator_and_points_the_right_way(folder):
    plain, judged = (task_of(small(folder, crop=32, adversarial=weight)) for weight in (0.0, 1e-3))
    before = [value.clone() for value in judged.discriminator.parameters()]
    for task in (plain, judged):
        task.begin(0)
        losses = task.step(0)
    assert set(losses) == {"mse", "adversarial", "discriminator"}
    assert not torch.equal(plain.network.up.weight, judged.network.up.weight)
    assert any(not torch.equal(old, new) for old, new in zip(before, judged.discriminator.parameters(), strict=True))
    assert all(value.requires_grad for value in judged.discriminator.parameters())
    bright, dark = torch.full((2, 3, 4, 4), 0.5), torch.full((2, 3, 4, 4), -0.5, requires_grad=True)
    assert comparator.discriminator_loss(Judge(), bright, dark) < 0.01
    assert comparator.discriminator_loss(Judge(), dark, bright) > 4
    assert comparator.adversarial_loss(Judge(), bright) < 0.01 and comparator.adversarial_loss(Judge(), dark) > 4
    comparator.discriminator_loss(comparator.Discriminator(), bright, dark).backward()
    assert dark.grad is None


def sha256(outcome):
    return checkpoint.read(outcome.weights)[0]["sha256"]


def test_seeds_decide_the_weights_that_a_command_trains_and_an_adversary_meets(folder, tmp_path):
    generator, again, other = (train(small(folder, epochs=1, seed=seed), tmp_path / name, device="cpu")
                               for name, seed in (("a", 1), ("b", 1), ("c", 2)))
    assert sha256(generator) == sha256(again) != sha256(other)
    judged = small(folder, network="paper-gan", crop=32, adversarial=1e-3, start=str(generator.weights))
    task, learned = task_of(judged), load("paper", 2, generator.weights).state_dict()
    assert all(torch.equal(value, learned[name]) for name, value in task.network.state_dict().items())
    assert task.identity() != task_of(dataclasses.replace(judged, start=str(other.weights))).identity()
    refuses(r"'Paper.*expected 'E", task_of, dataclasses.replace(judged, network="espcn"))
    settings = f"--set=photographs={folder} --set=validation= --set=scale=2 --set=crop=16 --set=epochs=1"
    assert main(["train", "paper", *settings.split(), "--output", str(tmp_path / "out"), "--device", "cpu"]) == 0
    assert (tmp_path / "out" / "paper-x2.safetensors").exists()


def test_training_lowers_the_loss_and_beats_its_start(folder, tmp_path):
    config = small(folder, epochs=30, crops_per_photograph=8, validate_every=30)
    photographs = comparator.load_photographs(folder)
    start = comparator.ComparatorTask(config, photographs, photographs, CPU).validate()
    trained, lines = train(config, tmp_path / "out", device="cpu"), read_log(tmp_path / "out" / "log.jsonl")
    assert lines[-1]["mse"] < 0.2 * lines[0]["mse"]
    assert trained.validation["validation.psnr"] > start["validation.psnr"] + 5
    facts = json.loads(trained.weights.with_suffix(".json").read_text())
    assert facts["config"] == dataclasses.asdict(config) and facts["data"]["photographs"]["files"] == 3
    assert facts["validation"]["bicubic.psnr"] > 20 and facts["multiply_adds_per_low_pixel"] == 10896
    loaded = load("paper", 2, trained.weights)
    assert checkpoint.digest({k: v.numpy() for k, v in loaded.state_dict().items()}) == facts["sha256"]


class SmallDiscriminator(nn.Sequential):
    """One convolution in place of eight."""

    def __init__(self):
        super().__init__(nn.Conv2d(3, 4, 3, 2), nn.BatchNorm2d(4), nn.AdaptiveAvgPool2d(1), nn.Flatten(),
                         nn.Linear(4, 1))


@pytest.mark.parametrize("changes", [{}, {"schedule": "cosine", "adversarial": 1e-3, "crop": 32}])
def test_resumed_training_gives_the_same_weights(folder, tmp_path, changes, monkeypatch):
    monkeypatch.setattr(comparator, "Discriminator", SmallDiscriminator)
    config, stop = small(folder, **changes), loop.Stop()
    whole = train(config, tmp_path / "whole", device="cpu")

    def tell(told):
        stop.asked = told.fraction > 0.4

    part = train(config, tmp_path / "part", device="cpu", options=loop.RunOptions(tell=tell, stop=stop))
    assert part.weights is None and part.stopped
    assert sha256(train(config, tmp_path / "part", device="cpu", options=loop.RunOptions(resume=True))) == sha256(whole)
