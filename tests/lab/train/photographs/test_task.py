"""The paper's recipe: losses, adversary and learning rates."""

from __future__ import annotations

import dataclasses

import pytest
import torch
from torch import nn

from lfsr_core.base.errors import LfsrError
from lfsr_lab.networks.networks import load
from lfsr_lab.train.photographs.task import (
    ComparatorTask,
    Discriminator,
    adversarial_loss,
    discriminator_loss,
    load_photographs,
)
from lfsr_lab.train.session import train
from tests.support.training_photographs import small, write_photographs

# The photographs are tiny: a second thread would only wait for the first.
torch.set_num_threads(1)
CPU = torch.device("cpu")


@pytest.fixture
def folder(tmp_path):
    return write_photographs(tmp_path / "photographs")


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


def test_cosine_schedule_falls_from_the_rate_to_zero(folder):
    task = ComparatorTask(small(folder, schedule="cosine", epochs=4), load_photographs(folder), None, CPU)
    rates = []
    for epoch in range(4):
        task.begin(epoch)
        rates.append(task._optimizer.param_groups[0]["lr"])
    assert rates == pytest.approx([1e-3, 0.8536e-3, 0.5e-3, 0.1464e-3], rel=1e-3)


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
    learned = load("paper", 2, generator).state_dict()
    assert all(torch.equal(value, learned[name]) for name, value in task.network.state_dict().items())
    other = train(small(folder, epochs=1, seed=5), tmp_path / "other", device="cpu").weights
    elsewhere = ComparatorTask(dataclasses.replace(judged, start=str(other)), load_photographs(folder), None, CPU)
    assert task.identity() != elsewhere.identity()
    with pytest.raises(LfsrError, match=r"'Paper.*expected 'E"):
        ComparatorTask(dataclasses.replace(judged, network="espcn"), load_photographs(folder), None, CPU)
