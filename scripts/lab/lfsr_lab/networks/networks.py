"""Comparators as PyTorch modules: untrained, or with their weights."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from torch import nn

from lfsr_core.base.errors import LfsrError
from lfsr_lab.networks import comparators
from lfsr_lab.networks.checkpoint import load_into
from lfsr_lab.networks.photograph_networks import ESPCN, FSRCNN, PaperGenerator

ARCHITECTURES: dict[str, Callable[..., nn.Module]] = {
    "PaperGenerator": PaperGenerator, "ESPCN": ESPCN, "FSRCNN": FSRCNN}


def build(name: str, scale: int) -> nn.Module:
    """Return an untrained network; LfsrError if it does not exist at that scale."""
    entry = comparators.spec(name)
    if scale not in comparators.SCALES:
        scales = ", ".join(map(str, comparators.SCALES))
        raise LfsrError(f"network {name!r} has no scale {scale}: choose one of {scales} or another method")
    return ARCHITECTURES[entry.architecture](scale=scale, **entry.options)


def load(name: str, scale: int, weights: str | Path | None = None) -> nn.Module:
    """Return a network with its weights, in evaluation mode, on the CPU; LfsrError if they do not fit."""
    network = build(name, scale)
    shipped = comparators.spec(name).weights
    path = Path(weights) if weights else shipped.get(scale)
    if path is None:
        scales = ", ".join(map(str, shipped)) or "no scale"
        raise LfsrError(f"network {name!r} has no weights for scale {scale} (there are some for {scales}): "
                        f"choose another scale or method, or train them with 'lfsr train'")
    return load_into(network, path, scale).eval()
