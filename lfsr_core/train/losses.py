"""Losses of the paper's recipe."""

from __future__ import annotations

import torch.nn.functional as F
from torch import Tensor, nn


def discriminator_loss(discriminator: nn.Module, real: Tensor, fake: Tensor) -> Tensor:
    """Binary cross-entropy with real images as 1 and generated ones as 0; ``fake`` is detached here."""
    on_real, on_fake = discriminator(real).float(), discriminator(fake.detach()).float()
    return (F.softplus(-on_real).mean() + F.softplus(on_fake).mean()) / 2


def adversarial_loss(discriminator: nn.Module, fake: Tensor) -> Tensor:
    """Generator's term: -log D(G(x)), which keeps a gradient where the discriminator is sure."""
    return F.softplus(-discriminator(fake).float()).mean()
