"""The networks that can be named. Imports no PyTorch; what needs it is imported when used."""

from __future__ import annotations

import importlib
import importlib.metadata
from pathlib import Path
from typing import Any

from lfsr_core.errors import LfsrError, did_you_mean
from lfsr_core.reconstruct.networks.spec import NetworkSpec

COMPARATORS = "lfsr.networks"  # entry points that name a dict of networks each; the laboratory has one
EVERY_SCALE = (2, 3, 4, 5, 8, 10)


def _ours(description: str, inputs: tuple[str, ...], size: tuple[int, int, int], after: tuple[str, ...],
          second_base: str = "", plain: float = 0.0) -> NetworkSpec:
    width, body_width, blocks = size
    options = {"inputs": inputs, "base": inputs[0], "width": width, "body_width": body_width, "blocks": blocks}
    options |= {"second_base": second_base, "plain": plain} if second_base else {}
    return NetworkSpec(description, "LightFieldNet", options, EVERY_SCALE,
                       ("albedo", "normal"), trained_at=4, after=after)


NETWORKS: dict[str, NetworkSpec] = {
    "refine": _ours("our network after oidn: mixes its pictures and gives back what they took, per elemental image",
                    ("oidn", "guided", "color", "alpha", "albedo", "normal"), (8, 16, 1),
                    after=("oidn-both", "oidn-guided", "oidn-half"), second_base="guided", plain=0.3),
    "light": _ours("our network without oidn: denoises and upscales each elemental image",
                   ("color", "alpha", "albedo", "normal"), (16, 32, 2), after=()),
    **{name: entry for point in importlib.metadata.entry_points(group=COMPARATORS)
       for name, entry in point.load().items()},
}

NAMES: dict[str, str] = {name: spec.description for name, spec in NETWORKS.items()}
"""Network names and one line on each, for menus."""


def spec(name: str) -> NetworkSpec:
    """Entry of NETWORKS; LfsrError with the nearest name if there is none."""
    if name not in NETWORKS:
        raise LfsrError(f"there is no network {name!r}: {did_you_mean(name, NETWORKS, cutoff=0).rstrip()}")
    return NETWORKS[name]


def weights_path(name: str, scale: int, folder: str | Path | None = None) -> Path:
    """Where the weights of a network at a scale are, in its own folder or in ``folder``, whether they exist or not."""
    entry = spec(name)
    return Path(folder or entry.folder) / f"{entry.weights or name}-x{entry.trained_at or scale}.safetensors"


def trained_scales(name: str) -> list[int]:
    """Scales for which weights ship."""
    return [scale for scale in spec(name).scales if weights_path(name, scale).exists()]


def upscaler(name: str, **settings: Any) -> Any:
    """What obeys ``contract.Upscaler``; weights load at the first call, when the scale is known.

    ``settings`` go to the upscaler's class (``weights``, ``device``, ``step``).
    LfsrError for an unknown name or a missing package.
    """
    return _class(spec(name).upscaler)(name, **settings)


def _class(reference: str) -> Any:
    """Class named "module:class"; LfsrError if PyTorch is not installed."""
    module, attribute = reference.split(":")
    try:
        return getattr(importlib.import_module(module), attribute)
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("lfsr_"):
            raise
        raise LfsrError(f"networks need the Python package {error.name!r}, which is not installed: "
                        f"install lfsr-lab[training] or choose a method without a network") from None
