"""Our networks as upscalers, in NumPy: no engine to install, in Blender neither.

Elemental images that have little to restore are only upscaled; several threads
work on different lenses (see assembly.py).
"""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct.encoding import encode
from lfsr_core.reconstruct.methods.interpolation import interpolate
from lfsr_core.reconstruct.networks import catalogue
from lfsr_core.reconstruct.networks.numpy_network import ElementalNetwork, conserve, load, network_inputs, steady_light

EIS_IN_CACHE = 4  # per step: the widest layer's patches of 20×20 pixels stay near 1 MB
KERNEL = "linear"
FLAT = 0.05  # range of encoded values below which an EI has little to restore, see docs/results/networks.md


class ElementalUpscaler:
    """A network of ours followed by linear upscaling, each EI on its own.

    No more than an EI needs: the network runs where ``needs_network`` says so, the
    others are only upscaled. ``weights``: another file than the shipped one. Where
    the frame lacks a layer that the network needs, no EI gets it. ``notes`` says
    what happened.
    """

    kernel, thread_safe = KERNEL, True

    def __init__(self, name: str, *, weights: str | Path | None = None, flat: float | None = None) -> None:
        self.name, self.counts = name, {"network": 0, "linear": 0}
        self._weights, self._flat = Path(weights) if weights else None, FLAT if flat is None else flat
        self._missing: tuple[str, ...] = ()
        self._lock = threading.Lock()

    @property
    def notes(self) -> list[str]:
        """For the report: where the network ran, and why not everywhere."""
        if self._missing:
            return [f"{self.name} needs the layers {', '.join(self._missing)}, which this frame lacks: "
                    "its elemental images were upscaled linearly instead"]
        total = sum(self.counts.values())
        return [f"{self.name} ran on {self.counts['network']} of {total} elemental images; the others are flat"]

    def __call__(self, low: LowResEIA, lenses: Array) -> Array:
        """EIs of ``lenses`` (N, 2), (N, h·s, w·s, 3) float32 scene-linear."""
        network, lenses = self._network(low), np.asarray(lenses)
        result = np.empty((len(lenses), *low.finished_views, 3), np.float32)
        for start in range(0, len(lenses), EIS_IN_CACHE):
            part = slice(start, start + EIS_IN_CACHE)
            interpolate(self._clean(network, low, lenses[part]), self.kernel, low.factors, result[part])
        return result

    def clean(self, low: LowResEIA, lenses: Array) -> Array:
        """What is upscaled: EIs of ``lenses``, (N, h, w, 3) in the domain of ``encoding.encode``."""
        return self._clean(self._network(low), low, np.asarray(lenses))

    def _network(self, low: LowResEIA) -> ElementalNetwork | None:
        network = load(self._weights or catalogue.weights_path(self.name, low.scale))
        self._missing = tuple(layer for layer in network.layers if layer not in low.layers)
        return None if self._missing else network

    def _clean(self, network: ElementalNetwork | None, low: LowResEIA, lenses: Array) -> Array:
        images = encode(low.color[lenses[:, 0], lenses[:, 1]])
        busy = needs_network(images, self._flat) & (network is not None)
        if network is not None and busy.any():
            cleaned = network(*network_inputs(network, low, lenses[busy]))
            rendered = low.rendered if "oidn" in network.inputs else low.color
            images[busy] = conserve(cleaned, steady_light(rendered[lenses[busy, 0], lenses[busy, 1]], cleaned))
        with self._lock:
            self.counts["network"] += int(busy.sum())
            self.counts["linear"] += int((~busy).sum())
        return images


def needs_network(images: Array, flat: float) -> Array:
    """(N,) bool: EIs (N, h, w, 3), encoded, whose values differ by more than ``flat`` in some channel."""
    # Axis by axis: over whole rows of pixels at once, not over three channels.
    return (images.max(1).max(1) - images.min(1).min(1)).max(-1) > flat
