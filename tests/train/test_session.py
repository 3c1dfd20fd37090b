"""Training from config to weights: settings, losses, resumption, commands."""

from __future__ import annotations

import dataclasses
import json

import pytest
import torch
from torch import nn

from lfsr_core.cli import main
from lfsr_core.errors import LfsrError
from lfsr_core.reconstruct.networks import catalogue
from lfsr_core.reconstruct.networks.pytorch import checkpoint
from lfsr_core.train import loop, suite
from lfsr_core.train.config import builtin_configs, load_config
from lfsr_core.train.log import read_log
from lfsr_core.train.photographs import task as comparator
from lfsr_core.train.photographs.data import load_photographs
from lfsr_core.train.photographs.discriminator import Discriminator
from lfsr_core.train.photographs.task import ComparatorTask, adversarial_loss, discriminator_loss
from lfsr_core.train.session import train
from tests.support.training_photographs import small, write_pictures

# The pictures are tiny: a second thread would only wait for the first.
torch.set_num_threads(1)
CPU = torch.device("cpu")


@pytest.fixture
def folder(tmp_path):
    return write_pictures(tmp_path / "photographs")


def test_every_builtin_config_is_valid_and_states_the_papers_recipe():
    assert {"paper", "paper-gan", "paper-short", "espcn", "fsrcnn", "paper-6"} <= set(builtin_configs())
    for name in builtin_configs():
        catalogue.spec(load_config(name, ["scenes=here"] if name in ("light", "refine") else []).network)
    recipe = load_config("paper-gan")
    assert (recipe.crop, recipe.batch, recipe.epochs, recipe.rate, recipe.adversarial) == (256, 8, 100, 1e-4, 1e-3)
    assert load_config("paper") == dataclasses.replace(recipe, network="paper", adversarial=0.0)


def test_settings_override_with_their_types():
    config = load_config("paper", ["epochs=3", "rate=1", "photographs=some/where", "augment=false"])
    assert (config.epochs, config.rate, config.photographs, config.augment) == (3, 1.0, "some/where", False)


@pytest.mark.parametrize(("settings", "message"), [
    (["epoch=3"], "unknown key 'epoch': did you mean 'epochs'"),
    (["epochs=many"], "epochs = 'many', expected a value of type int"),
    (["augment=1"], "augment = 1, expected a value of type bool"),
    (["epochs"], "not key=value"),
    (["crop=30"], "crop 30 is no multiple of scale 4"),
    (["downsample=lanczos"], "downsample 'lanczos' is unknown"),
    (["schedule=step"], "schedule 'step' is unknown"),
    (["rate=-1"], "must be positive"),
    (["batch=0"], "must be at least 1"),
])
def test_bad_settings(settings, message):
    with pytest.raises(LfsrError, match=message):
        load_config("paper", settings)


def test_missing_and_broken_config(tmp_path):
    with pytest.raises(LfsrError, match=r"no training config 'papr'.*paper-gan"):
        load_config("papr")
    (tmp_path / "a.toml").write_text("network = ")
    with pytest.raises(LfsrError, match="cannot be read"):
        load_config(str(tmp_path / "a.toml"))
    (tmp_path / "b.toml").write_text('network = "paper"')
    with pytest.raises(LfsrError, match="has no 'photographs'"):
        load_config(str(tmp_path / "b.toml"))


class Judge(nn.Module):
    """Logit = ten times the mean."""

    def forward(self, images):
        return 10 * images.mean((1, 2, 3))[:, None]


def test_adversarial_losses_point_the_right_way():
    bright, dark = torch.full((2, 3, 4, 4), 0.5), torch.full((2, 3, 4, 4), -0.5)
    assert discriminator_loss(Judge(), bright, dark) < 0.01
    assert discriminator_loss(Judge(), dark, bright) > 4
    assert adversarial_loss(Judge(), bright) < 0.01
    assert adversarial_loss(Judge(), dark) > 4


def test_discriminator_loss_leaves_the_generator_alone():
    fake = torch.rand(2, 3, 32, 32, requires_grad=True)
    discriminator_loss(Discriminator(), torch.rand(2, 3, 32, 32), fake).backward()
    assert fake.grad is None


def test_training_lowers_the_loss_and_beats_its_start(folder, tmp_path):
    config = small(folder, epochs=30, crops_per_photograph=8, validate_every=30)
    photographs = load_photographs(folder)
    start = ComparatorTask(config, photographs, photographs, CPU).validate()
    trained = train(config, tmp_path / "out", device="cpu")
    lines = read_log(tmp_path / "out" / "log.jsonl")
    assert lines[-1]["mse"] < 0.2 * lines[0]["mse"]
    assert trained.outcome.validation["validation.psnr"] > start["validation.psnr"] + 5
    facts = json.loads(trained.weights.with_suffix(".json").read_text())
    assert facts["config"] == dataclasses.asdict(config) and facts["data"]["photographs"]["files"] == 3
    assert facts["validation"]["bicubic.psnr"] > 20 and facts["multiply_adds_per_low_pixel"] == 10896
    loaded = catalogue.load("paper", 2, trained.weights)
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

    def progress(_stage, fraction, _message):
        stop.asked = fraction > 0.4

    part = train(config, tmp_path / "part", device="cpu", options=loop.RunOptions(progress=progress, stop=stop))
    assert part.weights is None and part.outcome.stopped
    resumed = train(config, tmp_path / "part", device="cpu", options=loop.RunOptions(resume=True))
    assert checkpoint.read(resumed.weights)[0]["sha256"] == checkpoint.read(whole.weights)[0]["sha256"]


def test_cosine_schedule_falls_from_the_rate_to_zero(folder):
    task = ComparatorTask(small(folder, schedule="cosine", epochs=4), load_photographs(folder), None, CPU)
    rates = []
    for epoch in range(4):
        task.begin(epoch)
        rates.append(task._optimizer.param_groups[0]["lr"])
    assert rates == pytest.approx([1e-3, 0.8536e-3, 0.5e-3, 0.1464e-3], rel=1e-3)


def test_seed_decides_the_weights(folder, tmp_path):
    runs = [train(small(folder, epochs=1, seed=seed), tmp_path / name, device="cpu")
            for name, seed in (("a", 1), ("b", 1), ("c", 2))]
    hashes = [checkpoint.read(run.weights)[0]["sha256"] for run in runs]
    assert hashes[0] == hashes[1] != hashes[2]


def test_adversary_changes_the_generator_and_learns(folder):
    photographs = load_photographs(folder)
    plain, judged = (ComparatorTask(small(folder, crop=32, adversarial=weight), photographs, None, CPU)
                     for weight in (0.0, 1e-3))
    before = [value.clone() for value in judged.discriminator.parameters()]
    for task in (plain, judged):
        task.begin(0)
        losses = task.step(0)
    assert set(losses) == {"mse", "adversarial", "discriminator"}
    assert not torch.equal(plain.network.up.weight, judged.network.up.weight)
    assert any(not torch.equal(old, new) for old, new in zip(before, judged.discriminator.parameters(), strict=True))
    assert all(value.requires_grad for value in judged.discriminator.parameters())


def test_a_generator_meets_its_adversary_with_what_it_has_learned(folder, tmp_path):
    generator = train(small(folder, epochs=2), tmp_path / "generator", device="cpu").weights
    judged = small(folder, network="paper-gan", crop=32, adversarial=1e-3, start=str(generator))
    task = ComparatorTask(judged, load_photographs(folder), None, CPU)
    learned = catalogue.load("paper", 2, generator).state_dict()
    assert all(torch.equal(value, learned[name]) for name, value in task.network.state_dict().items())
    other = train(small(folder, epochs=1, seed=5), tmp_path / "other", device="cpu").weights
    elsewhere = ComparatorTask(dataclasses.replace(judged, start=str(other)), load_photographs(folder), None, CPU)
    assert task.identity() != elsewhere.identity()
    with pytest.raises(LfsrError, match=r"'Paper.*expected 'E"):
        ComparatorTask(dataclasses.replace(judged, network="espcn"), load_photographs(folder), None, CPU)


@pytest.mark.skipif(torch.cuda.is_available(), reason="says what happens without CUDA")
def test_absent_gpu(folder, tmp_path):
    with pytest.raises(LfsrError, match="'cuda' is not available"):
        train(small(folder), tmp_path, device="cuda")


def test_command_trains_stops_and_packs(folder, tmp_path, capsys):
    settings = [f"--set={key}={value}" for key, value in {
        "photographs": folder, "validation": "", "scale": 2, "crop": 16, "crops_per_photograph": 2, "epochs": 1,
    }.items()]
    assert main(["train", "paper", *settings, "--output", str(tmp_path / "out"), "--device", "cpu"]) == 0
    assert (tmp_path / "out" / "paper-x2.safetensors").exists()
    assert main(["train", "--prepare-photographs", str(folder), "--cache", str(tmp_path / "cache.npz")]) == 0
    assert len(load_photographs(tmp_path / "cache.npz").images) == 3
    capsys.readouterr()
    assert main(["train"]) == 2
    assert main(["train", "--prepare-photographs", str(folder)]) == 2
    errors = capsys.readouterr().err
    assert "nothing to train" in errors and "--cache" in errors


@pytest.mark.slow
def test_suite_trains_what_it_is_told_in_processes(folder, tmp_path, capsys):
    command = ["--cache", str(folder), "--validation", str(folder), "--output", str(tmp_path), "--device", "cpu",
               "--jobs", "2", "--threads", "1", "--only", "paper-x2,espcn-x2", "--set", "epochs=1", "--set", "crop=16",
               "--set", "crops_per_photograph=2"]
    assert suite.main(command) == 0
    assert {"paper-x2.safetensors", "paper-x2.json", "espcn-x2.safetensors", "suite.json", "paper-x2.log.jsonl"} <= {
        path.name for path in tmp_path.iterdir()}
    assert suite.main([*command, "--set", "crop=15", "--output", str(tmp_path / "bad")]) == 1
    assert "no multiple of scale" in capsys.readouterr().out
    assert suite.main([*command, "--only", "nothing"]) == 2
