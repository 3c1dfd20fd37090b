"""The networks that can be named as upscalers. What needs PyTorch is imported when it is used."""

from __future__ import annotations

import importlib
import importlib.metadata
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lfsr_core.errors import LfsrError, did_you_mean
from lfsr_core.reconstruct.contract import Upscaler
from lfsr_core.reconstruct.networks.spec import NetworkSpec

COMPARATORS = "lfsr.networks"  # group of entry points, each a dict of networks by name; the laboratory has one
EVERY_SCALE = (2, 3, 4, 5, 8, 10)


def _ours(description: str, inputs: tuple[str, ...], size: tuple[int, int, int], after: tuple[str, ...],
          second_base: str = "", plain: float = 0.0) -> NetworkSpec:
    width, body_width, blocks = size
    options = dict[str, Any](inputs=inputs, base=inputs[0], width=width, body_width=body_width, blocks=blocks)
    options |= {"second_base": second_base, "plain": plain} if second_base else {}
    return NetworkSpec(description, "LightFieldNet", options, EVERY_SCALE,
                       ("albedo", "normal"), trained_at=4, after=after)


NETWORKS: dict[str, NetworkSpec] = {
    "refine": _ours("our network after oidn: mixes its images and restores detail, per elemental image",
                    ("oidn", "guided", "color", "alpha", "albedo", "normal"), (8, 16, 1),
                    after=("oidn-both", "oidn-guided", "oidn-half"), second_base="guided", plain=0.3),
    "light": _ours("our network without oidn: denoises and upscales each elemental image",
                   ("color", "alpha", "albedo", "normal"), (16, 32, 2), after=()),
    **{name: entry for point in importlib.metadata.entry_points(group=COMPARATORS)
       for name, entry in point.load().items()},
}

NAMES: dict[str, str] = {name: spec.description for name, spec in NETWORKS.items()}
"""Description of each network, for menus."""


def spec(name: str) -> NetworkSpec:
    """Network of NETWORKS by name; LfsrError with the nearest name for another."""
    if name not in NETWORKS:
        raise LfsrError(f"there is no network {name!r}: {did_you_mean(name, NETWORKS, cutoff=0).rstrip()}")
    return NETWORKS[name]


def weights_path(name: str, scale: int, folder: str | Path | None = None) -> Path:
    """Path of a network's weights at a scale, in its own folder or in ``folder``, whether the file exists or not."""
    entry = spec(name)
    return Path(folder or entry.folder) / f"{entry.weights or name}-x{entry.trained_at or scale}.safetensors"


def trained_scales(name: str) -> list[int]:
    """Scales for which there are weights."""
    return [scale for scale in spec(name).scales if weights_path(name, scale).exists()]


def upscaler(name: str, **settings: Any) -> Upscaler:
    """Make the ``contract.Upscaler`` of a network; its weights load at the first call, when the scale is known.

    ``settings``: for the upscaler's class (``weights``, ``device``). LfsrError for an unknown name or a
    missing package.
    """
    module, attribute = spec(name).upscaler.split(":")
    try:
        kind: Callable[..., Upscaler] = getattr(importlib.import_module(module), attribute)
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("lfsr_"):
            raise
        raise LfsrError(f"networks need the Python package {error.name!r}, which is not installed: "
                        f"install lfsr-lab[training] or choose a method without a network") from None
    return kind(name, **settings)
