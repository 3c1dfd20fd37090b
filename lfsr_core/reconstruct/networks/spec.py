"""Description of a network that can be named as a method's upscaler."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

WEIGHTS_FOLDER = Path(__file__).parent / "weights"
LIGHT_FIELD_UPSCALER = "lfsr_core.reconstruct.networks.elemental:ElementalUpscaler"


@dataclass(frozen=True)
class NetworkSpec:
    """A network: its architecture, its weights and how to run it."""

    description: str  # one line for menus
    architecture: str  # its class, a name of ``lfsr_lab.networks.networks.ARCHITECTURES``
    options: Mapping[str, Any] = field(default_factory=dict)  # arguments of that class besides the scale
    scales: tuple[int, ...] = (2, 3, 4, 8)  # scales that it exists for
    layers: tuple[str, ...] = ()  # auxiliary layers that it needs
    upscaler: str = LIGHT_FIELD_UPSCALER  # "module:class" of a ``contract.Upscaler``, called as (name, **settings)
    weights: str | None = None  # stem of the weights' files, if it is not the name
    trained_at: int | None = None  # the scale it was trained at, if its weights serve all scales
    after: tuple[str, ...] = ()  # prefilters, the best first, of which one must come before it
    folder: Path = WEIGHTS_FOLDER  # of the weights' files

    @property
    def light_field(self) -> bool:
        """True for our networks, trained on rendered light fields; the others were trained on photographs."""
        return self.upscaler == LIGHT_FIELD_UPSCALER

    def chain(self, name: str) -> str:
        """Method of this network, by its ``name``, and the best prefilter before it."""
        return "+".join((*self.after[:1], name))
