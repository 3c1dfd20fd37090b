"""Run our networks in NumPy, so that Blender needs no deep-learning engine.

Several threads may work on different lenses (see assembly.py).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct.encoding import encode
from lfsr_core.reconstruct.methods.interpolation import finish_in_steps, interpolated
from lfsr_core.reconstruct.networks import catalogue
from lfsr_core.reconstruct.networks.numpy_network import ElementalNetwork, conserve, load, network_inputs, steady_light

EIS_IN_CACHE = 4  # per step: the widest layer's patches of 20×20 pixels stay near 1 MB
FLAT = 0.05  # range of encoded values up to which an EI has little to restore, see docs/notebook/networks.md


class ElementalUpscaler:
    """A network of ours and linear upscaling after it, each EI on its own (see ``contract.Upscaler``).

    EIs for which ``needs_network`` is False are only upscaled, as are all where the frame lacks a layer that the
    network needs. ``weights``: file instead of the shipped one. ``flat``: see ``needs_network``.
    """

    kernel, thread_safe = "linear", True

    def __init__(self, name: str, *, weights: str | Path | None = None, flat: float = FLAT) -> None:
        self.name, self.notes = name, list[str]()
        self._weights, self._flat = Path(weights) if weights else None, flat

    def __call__(self, low: LowResEIA, lenses: Array) -> Array:
        """EIs of ``lenses`` (N, 2), (N, h·s, w·s, 3) float32 scene-linear."""
        network = self._network(low)
        return finish_in_steps(low, np.asarray(lenses), EIS_IN_CACHE, lambda part, out: interpolated(
            self._clean(network, low, part), self.kernel, low.factors, out=out))

    def clean(self, low: LowResEIA, lenses: Array) -> Array:
        """EIs of ``lenses`` before upscaling, (N, h, w, 3) encoded."""
        return self._clean(self._network(low), low, np.asarray(lenses))

    def _network(self, low: LowResEIA) -> ElementalNetwork | None:
        network = load(self._weights or catalogue.weights_path(self.name, low.scale))
        missing = [layer for layer in network.layers if layer not in low.layers]
        self.notes = [f"{self.name} needs the layers {', '.join(missing)}, which this frame lacks: its elemental "
                      "images were upscaled linearly instead"] * bool(missing)
        return None if missing else network

    def _clean(self, network: ElementalNetwork | None, low: LowResEIA, lenses: Array) -> Array:
        images = encode(low.color[lenses[:, 0], lenses[:, 1]])
        busy = needs_network(images, self._flat)
        if network is not None and busy.any():
            cleaned = network(*network_inputs(network, low, lenses[busy]))
            rendered = low.rendered if "oidn" in network.inputs else low.color
            images[busy] = conserve(cleaned, steady_light(rendered[lenses[busy, 0], lenses[busy, 1]], cleaned))
        return images


def needs_network(images: Array, flat: float) -> Array:
    """(N,) bool: whether the values of an encoded EI (N, h, w, 3) differ by more than ``flat`` in some channel."""
    # One axis after the other, so that whole rows of pixels are compared at once.
    return np.asarray((images.max(1).max(1) - images.min(1).min(1)).max(-1) > flat)
