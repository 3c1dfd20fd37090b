"""Networks behind the contract of ``upscale.py``: one dict of names, everything else imported when used.

Importing this module imports no torch.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lfsr_core.errors import LfsrError, did_you_mean

if TYPE_CHECKING:
    from torch import nn

PYTORCH = "lfsr_core.reconstruct.networks.pytorch"
WEIGHTS_FOLDER = Path(__file__).parent / "weights"
PHOTOGRAPH_UPSCALER = f"{PYTORCH}.upscalers:PhotographUpscaler"
LIGHT_FIELD_UPSCALER = "lfsr_core.reconstruct.networks.elemental:ElementalUpscaler"
EVERY_SCALE = (2, 3, 4, 5, 8, 10)


@dataclass(frozen=True)
class NetworkSpec:
    """One network that can be named on the command line.

    ``architecture``: "module:class"; the class takes ``scale`` and ``options``.
    ``layers``: auxiliary layers it needs. ``upscaler``: "module:class" taking (name, **settings) and obeying
    the contract of ``upscale.py``. ``weights``: file stem if not the name.
    ``trained_at``: the one scale it was trained at, if its weights serve all. ``after``: prefilter
    that must come before it.
    """

    description: str
    architecture: str
    options: Mapping[str, Any] = field(default_factory=dict)
    scales: tuple[int, ...] = (2, 3, 4, 8)
    layers: tuple[str, ...] = ()
    upscaler: str = PHOTOGRAPH_UPSCALER
    weights: str | None = None
    trained_at: int | None = None
    after: str | None = None

    @property
    def light_field(self) -> bool:
        """True for our networks, trained on rendered light fields; the others saw photographs."""
        return self.upscaler == LIGHT_FIELD_UPSCALER


def _ours(description: str, inputs: tuple[str, ...], size: tuple[int, int, int], after: str | None,
          second_base: str = "") -> NetworkSpec:
    width, body_width, blocks = size
    options = {"inputs": inputs, "base": inputs[0], "width": width, "body_width": body_width, "blocks": blocks}
    options |= {"second_base": second_base} if second_base else {}
    return NetworkSpec(description, f"{PYTORCH}.lightfield:build", options, EVERY_SCALE,
                       ("albedo", "normal"), upscaler=LIGHT_FIELD_UPSCALER, trained_at=4, after=after)


def _paper(convolutions: int, description: str) -> NetworkSpec:
    return NetworkSpec(description, f"{PYTORCH}.paper:PaperGenerator", {"convolutions": convolutions})


NETWORKS: dict[str, NetworkSpec] = {
    "refine": _ours("our network after oidn-both: mixes the two and gives back what they took, per elemental image",
                    ("oidn", "guided", "color", "alpha", "albedo", "normal"), (8, 16, 1), after="oidn-both",
                    second_base="guided"),
    "light": _ours("our network without oidn: denoises and upscales each elemental image",
                   ("color", "alpha", "albedo", "normal"), (16, 32, 2), after=None),
    "paper": _paper(2, "the paper's generator per EI, trained with MSE only"),
    "paper-gan": _paper(2, "the paper's generator per EI, trained with its discriminator"),
    **{f"paper-{n}": _paper(n, f"the paper's generator with {n} convolutions, MSE only") for n in (3, 4, 5, 6)},
    "espcn": NetworkSpec("ESPCN per EI", f"{PYTORCH}.espcn:ESPCN"),
    "fsrcnn": NetworkSpec("FSRCNN(56, 12, 4) per EI", f"{PYTORCH}.fsrcnn:FSRCNN"),
    "fsrcnn-eia": NetworkSpec("FSRCNN over the whole EIA: crosstalk between EIs", f"{PYTORCH}.fsrcnn:FSRCNN",
                              upscaler=f"{PYTORCH}.upscalers:WholeEIAUpscaler", weights="fsrcnn"),
    "paper-eia": NetworkSpec("the paper's generator over the whole EIA: crosstalk between EIs",
                             f"{PYTORCH}.paper:PaperGenerator", {"convolutions": 2},
                             upscaler=f"{PYTORCH}.upscalers:WholeEIAUpscaler", weights="paper"),
}

NAMES: dict[str, str] = {name: spec.description for name, spec in NETWORKS.items()}
"""Network names and one line on each, for menus."""


def spec(name: str) -> NetworkSpec:
    """Entry of NETWORKS; LfsrError with the nearest name if there is none."""
    if name not in NETWORKS:
        raise LfsrError(f"there is no network {name!r}: {did_you_mean(name, NETWORKS, cutoff=0).rstrip()}")
    return NETWORKS[name]


def build(name: str, scale: int) -> nn.Module:
    """Untrained network; LfsrError if it does not come at that scale or torch is missing."""
    entry = spec(name)
    if scale not in entry.scales:
        scales = ", ".join(map(str, entry.scales))
        raise LfsrError(f"network {name!r} has no scale {scale}: choose one of {scales} or another method")
    return resolve(entry.architecture)(scale=scale, **entry.options)


def weights_path(name: str, scale: int, folder: str | Path = WEIGHTS_FOLDER) -> Path:
    """Where the weights of a network at a scale lie, whether they exist or not."""
    entry = spec(name)
    return Path(folder) / f"{entry.weights or name}-x{entry.trained_at or scale}.safetensors"


def trained_scales(name: str) -> list[int]:
    """Scales for which weights ship."""
    return [scale for scale in spec(name).scales if weights_path(name, scale).exists()]


def load(name: str, scale: int, weights: str | Path | None = None) -> nn.Module:
    """Network with its weights, in evaluation mode, on the CPU; LfsrError if they do not fit."""
    network = build(name, scale)
    path = Path(weights) if weights else weights_path(name, scale)
    if weights is None and not path.exists():
        scales = ", ".join(map(str, trained_scales(name))) or "no scale"
        raise LfsrError(f"network {name!r} has no weights for scale {scale} (there are some for {scales}): "
                        f"choose another scale or method, or train them with 'lfsr train'")
    return resolve(f"{PYTORCH}.checkpoint:load_into")(network, path, spec(name).trained_at or scale).eval()


def upscaler(name: str, **settings: Any) -> Any:
    """Upscaler of the contract in ``upscale.py``; weights load at the first call, when the scale is known.

    ``settings`` go to the upscaler's class (``weights``, ``device``, ``step``).
    LfsrError for an unknown name or a missing package.
    """
    return resolve(spec(name).upscaler)(name, **settings)


def resolve(reference: str) -> Any:
    """Object named "module:attribute"; LfsrError if torch is not installed."""
    module, attribute = reference.split(":")
    try:
        return getattr(importlib.import_module(module), attribute)
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("lfsr_core"):
            raise
        raise LfsrError(f"networks need the Python package {error.name!r}, which is not installed: "
                        f"install lfsr[training] or choose a method without a network") from None
