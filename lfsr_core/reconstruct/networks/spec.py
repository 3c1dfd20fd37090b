"""What a network is: the record behind a name on the command line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

WEIGHTS_FOLDER = Path(__file__).parent / "weights"
LIGHT_FIELD_UPSCALER = "lfsr_core.reconstruct.networks.elemental:ElementalUpscaler"


@dataclass(frozen=True)
class NetworkSpec:
    """One network that can be named on the command line."""

    description: str  # one line for menus
    architecture: str  # its class, by name of ``lfsr_lab.networks.networks.ARCHITECTURES``
    options: Mapping[str, Any] = field(default_factory=dict)  # what that class takes beside the scale
    scales: tuple[int, ...] = (2, 3, 4, 8)  # those it comes in
    layers: tuple[str, ...] = ()  # auxiliary layers that it needs
    upscaler: str = LIGHT_FIELD_UPSCALER  # "module:class" that takes (name, **settings) and obeys ``contract.Upscaler``
    weights: str | None = None  # stem of its files, if that is not its name
    trained_at: int | None = None  # the one scale it was trained at, if its weights serve all
    after: tuple[str, ...] = ()  # prefilters of which one must come before it, the best first
    folder: Path = WEIGHTS_FOLDER  # where its weights are

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
