"""Training from config to weights: what it writes, resumption, seeds, commands."""

from __future__ import annotations

import dataclasses
import json

import pytest
import torch
from torch import nn

from lfsr_core.cli import main
from lfsr_lab.networks import checkpoint
from lfsr_lab.networks.networks import load
from lfsr_lab.train import loop
from lfsr_lab.train.loop import read_log
from lfsr_lab.train.photographs import task as comparator
from lfsr_lab.train.photographs.task import ComparatorTask, load_photographs
from lfsr_lab.train.session import train
from tests.support.training_photographs import small, write_photographs

# The photographs are tiny: a second thread would only wait for the first.
torch.set_num_threads(1)
CPU = torch.device("cpu")


@pytest.fixture
def folder(tmp_path):
    return write_photographs(tmp_path / "photographs")


def test_training_lowers_the_loss_and_beats_its_start(folder, tmp_path):
    config = small(folder, epochs=30, crops_per_photograph=8, validate_every=30)
    photographs = load_photographs(folder)
    start = ComparatorTask(config, photographs, photographs, CPU).validate()
    trained = train(config, tmp_path / "out", device="cpu")
    lines = read_log(tmp_path / "out" / "log.jsonl")
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


@pytest.mark.parametrize("changes", [{}, {"schedule": "cosine"}, {"adversarial": 1e-3, "crop": 32}])
def test_resumed_training_gives_the_same_weights(folder, tmp_path, changes, monkeypatch):
    monkeypatch.setattr(comparator, "Discriminator", SmallDiscriminator)
    config = small(folder, **changes)
    whole = train(config, tmp_path / "whole", device="cpu")
    stop = loop.Stop()

    def tell(told):
        stop.asked = told.fraction > 0.4

    part = train(config, tmp_path / "part", device="cpu", options=loop.RunOptions(tell=tell, stop=stop))
    assert part.weights is None and part.stopped
    resumed = train(config, tmp_path / "part", device="cpu", options=loop.RunOptions(resume=True))
    assert checkpoint.read(resumed.weights)[0]["sha256"] == checkpoint.read(whole.weights)[0]["sha256"]


def test_seed_decides_the_weights(folder, tmp_path):
    runs = [train(small(folder, epochs=1, seed=seed), tmp_path / name, device="cpu")
            for name, seed in (("a", 1), ("b", 1), ("c", 2))]
    hashes = [checkpoint.read(run.weights)[0]["sha256"] for run in runs]
    assert hashes[0] == hashes[1] != hashes[2]


def test_command_trains(folder, tmp_path):
    settings = [f"--set={key}={value}" for key, value in {
        "photographs": folder, "validation": "", "scale": 2, "crop": 16, "crops_per_photograph": 2, "epochs": 1,
    }.items()]
    assert main(["train", "paper", *settings, "--output", str(tmp_path / "out"), "--device", "cpu"]) == 0
    assert (tmp_path / "out" / "paper-x2.safetensors").exists()
