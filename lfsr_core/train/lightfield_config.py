"""What a training run of a light-field network is: a TOML file of known keys."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from lfsr_core import networks

if TYPE_CHECKING:
    from lfsr_core.networks.lightfield import LightFieldConfig


@dataclasses.dataclass(frozen=True)
class LightFieldTrainConfig:
    """Training of a network of ours on a folder of rendered ``scenes`` (*.npz).

    ``scale``: of those scenes. An epoch is ``steps_per_epoch`` batches of
    ``batch`` whole scenes at one sample count each. ``view_weight``,
    ``pixel_weight``: of the loss over decoded views and of the squared error, beside 1
    for the EIA. ``clean_inputs``: the ablation that trains on
    downsampled references instead of renders. ``without``: inputs to leave out;
    ``spatial``, ``width``, ``body_width``, ``blocks``: another architecture than the registered one.
    """

    network: str
    scenes: str
    scale: int = 4
    seed: int = 0
    epochs: int = 20
    steps_per_epoch: int = 250
    batch: int = 1
    rate: float = 2e-3
    view_weight: float = 0.5
    pixel_weight: float = 10.0
    clean_inputs: bool = False
    without: str = ""
    spatial: bool = False
    width: int = 0
    body_width: int = 0
    blocks: int = -1
    validate_every: int = 2
    checkpoint_every: int = 1

    @property
    def architecture(self) -> LightFieldConfig:
        """Size and inputs of the network to train."""
        from lfsr_core.networks.lightfield import LightFieldConfig

        return LightFieldConfig(**self.options())

    def options(self) -> dict[str, Any]:
        """The same as plain values, for the header of the weights."""
        options = dict(networks.spec(self.network).options)
        options["inputs"] = tuple(name for name in options["inputs"] if name not in self.without.split(","))
        if options.get("second_base") not in options["inputs"]:
            options.pop("second_base", None)
        own = {"width": self.width or None, "body_width": self.body_width or None,
               "blocks": None if self.blocks < 0 else self.blocks, "spatial": self.spatial or None}
        return options | {name: value for name, value in own.items() if value is not None}
