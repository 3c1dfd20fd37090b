"""The networks that can be named: one dict of what each is. Imports no PyTorch; what needs it is imported when used."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lfsr_core.errors import LfsrError, did_you_mean

PYTORCH = "lfsr_core.reconstruct.networks.pytorch"
WEIGHTS_FOLDER = Path(__file__).parent / "weights"
PHOTOGRAPH_UPSCALER = f"{PYTORCH}.upscalers:PhotographUpscaler"
LIGHT_FIELD_UPSCALER = "lfsr_core.reconstruct.networks.elemental:ElementalUpscaler"
EVERY_SCALE = (2, 3, 4, 5, 8, 10)


@dataclass(frozen=True)
class NetworkSpec:
    """One network that can be named on the command line."""

    description: str  # one line for menus
    architecture: str  # its class, by name of ``pytorch.networks.ARCHITECTURES``
    options: Mapping[str, Any] = field(default_factory=dict)  # what that class takes beside the scale
    scales: tuple[int, ...] = (2, 3, 4, 8)  # those it comes in
    layers: tuple[str, ...] = ()  # auxiliary layers that it needs
    upscaler: str = PHOTOGRAPH_UPSCALER  # "module:class" that takes (name, **settings) and obeys ``contract.Upscaler``
    weights: str | None = None  # stem of its files, if that is not its name
    trained_at: int | None = None  # the one scale it was trained at, if its weights serve all
    after: tuple[str, ...] = ()  # prefilters of which one must come before it, the best first

    @property
    def light_field(self) -> bool:
        """True for our networks, trained on rendered light fields; the others saw photographs."""
        return self.upscaler == LIGHT_FIELD_UPSCALER

    @property
    def mixes(self) -> bool:
        """True for a network that takes two denoised pictures."""
        return "second_base" in self.options

    def chain(self, name: str) -> str:
        """The method that it is meant for, of this network's ``name``: with what should come before it."""
        return "+".join((*self.after[:1], name))


def _ours(description: str, inputs: tuple[str, ...], size: tuple[int, int, int], after: tuple[str, ...],
          second_base: str = "", plain: float = 0.0) -> NetworkSpec:
    width, body_width, blocks = size
    options = {"inputs": inputs, "base": inputs[0], "width": width, "body_width": body_width, "blocks": blocks}
    options |= {"second_base": second_base, "plain": plain} if second_base else {}
    return NetworkSpec(description, "LightFieldNet", options, EVERY_SCALE,
                       ("albedo", "normal"), upscaler=LIGHT_FIELD_UPSCALER, trained_at=4, after=after)


def _paper(convolutions: int, description: str) -> NetworkSpec:
    return NetworkSpec(description, "PaperGenerator", {"convolutions": convolutions})


NETWORKS: dict[str, NetworkSpec] = {
    "refine": _ours("our network after oidn: mixes its pictures and gives back what they took, per elemental image",
                    ("oidn", "guided", "color", "alpha", "albedo", "normal"), (8, 16, 1),
                    after=("oidn-both", "oidn-guided", "oidn-half"), second_base="guided", plain=0.3),
    "light": _ours("our network without oidn: denoises and upscales each elemental image",
                   ("color", "alpha", "albedo", "normal"), (16, 32, 2), after=()),
    "paper": _paper(2, "the paper's generator per EI, trained with MSE only"),
    "paper-gan": _paper(2, "the paper's generator per EI, trained with its discriminator"),
    **{f"paper-{n}": _paper(n, f"the paper's generator with {n} convolutions, MSE only") for n in (3, 4, 5, 6)},
    "espcn": NetworkSpec("ESPCN per EI", "ESPCN"),
    "fsrcnn": NetworkSpec("FSRCNN(56, 12, 4) per EI", "FSRCNN"),
    "fsrcnn-eia": NetworkSpec("FSRCNN over the whole EIA: crosstalk between EIs", "FSRCNN",
                              upscaler=f"{PYTORCH}.upscalers:WholeEIAUpscaler", weights="fsrcnn"),
    "paper-eia": NetworkSpec("the paper's generator over the whole EIA: crosstalk between EIs",
                             "PaperGenerator", {"convolutions": 2},
                             upscaler=f"{PYTORCH}.upscalers:WholeEIAUpscaler", weights="paper"),
}

NAMES: dict[str, str] = {name: spec.description for name, spec in NETWORKS.items()}
"""Network names and one line on each, for menus."""


def spec(name: str) -> NetworkSpec:
    """Entry of NETWORKS; LfsrError with the nearest name if there is none."""
    if name not in NETWORKS:
        raise LfsrError(f"there is no network {name!r}: {did_you_mean(name, NETWORKS, cutoff=0).rstrip()}")
    return NETWORKS[name]


def weights_path(name: str, scale: int, folder: str | Path = WEIGHTS_FOLDER) -> Path:
    """Where the weights of a network at a scale lie, whether they exist or not."""
    entry = spec(name)
    return Path(folder) / f"{entry.weights or name}-x{entry.trained_at or scale}.safetensors"


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
        if (error.name or "").startswith("lfsr_core"):
            raise
        raise LfsrError(f"networks need the Python package {error.name!r}, which is not installed: "
                        f"install lfsr[training] or choose a method without a network") from None
