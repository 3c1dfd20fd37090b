"""Comparators as upscalers.

They were trained on photographs, so they see sRGB values clipped to [0, 1]: highlights above 1 are lost.
"""

from __future__ import annotations

import copy
import math
import warnings
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.reconstruct.upscaler import LowResEIA, Upscaler
from lfsr_lab.networks.networks import fold_for_inference, load

DEVICES = ("auto", "cpu", "cuda")
# Low-resolution pixels per step, measured best on two CPU cores and on one GPU: 16 and 1296 EIs of 20×20.
PIXELS_PER_STEP = {"cpu": 6_400, "cuda": 518_400}


class Engine:
    """A network on one device: scene-linear EIs in and out, while the network sees sRGB values.

    The network's deconvolutions run as convolutions, channels last; on a GPU in half precision.
    ``device`` "auto" is the GPU if there is one. ``step``: elemental images per call, None for the best
    of PIXELS_PER_STEP. LfsrError for an unknown or absent device, or a step below 1.
    """

    def __init__(self, network: nn.Module, *, device: str = "auto", step: int | None = None) -> None:
        if step is not None and step < 1:
            raise LfsrError(f"step is {step}, but it must be 1 or more elemental images per call")
        self.device, self.step = choose_device(device), step
        self._dtype = torch.float16 if self.device.type == "cuda" else torch.float32
        folded = fold_for_inference(copy.deepcopy(network)).to(self.device, self._dtype)
        # PyTorch's stubs lack this overload.
        folded = folded.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._network = folded.requires_grad_(False)

    def __call__(self, linear: Array) -> Array:
        """Return (N, s·h, s·w, 3) float32 in [0, 1] of (N, h, w, 3) float32."""
        low = torch.from_numpy(np.ascontiguousarray(linear, np.float32))
        return np.asarray(self.run(low).cpu().numpy())

    @torch.inference_mode()
    def run(self, low: Tensor) -> Tensor:
        """Return the same for tensors, on the engine's device."""
        step = self.step or max(1, PIXELS_PER_STEP[self.device.type] // (low.shape[1] * low.shape[2]))
        made = []
        for batch in low.split(step):
            encoded = srgb_encode(batch.to(self.device, non_blocking=True)).permute(0, 3, 1, 2)
            high = self._network(encoded.to(self._dtype, memory_format=torch.channels_last))
            made.append(srgb_decode(high.permute(0, 2, 3, 1).float()))
        return torch.cat(made)


def choose_device(name: str) -> torch.device:
    """Return the device "cpu", "cuda" or "auto"; LfsrError for another name, or if CUDA is absent."""
    if name not in DEVICES:
        raise LfsrError(f"device is {name!r}, but it must be one of {', '.join(DEVICES)}")
    on_gpu = name != "cpu" and torch.cuda.is_available()
    if name == "cuda" and not on_gpu:
        raise LfsrError("device 'cuda' is not available on this machine: choose cpu or auto")
    return torch.device("cuda" if on_gpu else "cpu")


def srgb_encode(linear: Tensor) -> Tensor:
    """sRGB curve (IEC 61966-2-1) of linear values clipped to [0, 1]; any shape, result in [0, 1]."""
    linear = linear.clamp(0, 1)
    # The power's slope at 0 is infinite, and where() would pass it to the gradient.
    return torch.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear.clamp_min(0.0031308) ** (1 / 2.4) - 0.055)


def srgb_decode(encoded: Tensor) -> Tensor:
    """Linear light of sRGB values clipped to [0, 1]; any shape."""
    encoded = encoded.clamp(0, 1)
    return torch.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


# Reach of the widest comparator (FSRCNN: 5×5, four 3×3 and 9×9 at stride s) in low-resolution pixels.
RECEPTIVE_RADIUS = 11
ROWS_AT_ONCE = 8


class PhotographUpscaler(Upscaler):
    """A network trained on photographs, applied to each EI on its own.

    ``notes``: sentences on its calls. ``thread_safe`` is False: the engine uses every core itself.
    """

    def __init__(self, name: str, *, weights: str | Path | None = None, device: str = "auto") -> None:
        self.name = name
        self.notes: list[str] = []
        self._weights, self._device = weights, device
        self._engines: dict[int, Engine] = {}

    def prepare(self, low: LowResEIA) -> LowResEIA:
        """Return ``low``; LfsrError where its views differ along one axis."""
        if not all(low.parallax):
            raise LfsrError(f"network {self.name!r} needs views in two directions, but this display has one: choose a "
                            "method without a network")
        return low

    def __call__(self, low: LowResEIA, lenses: Array) -> Array:
        """Return the EIs of ``lenses`` (N, 2), (N, h·s, w·s, 3) float32 scene-linear in [0, 1]."""
        lenses = np.asarray(lenses)
        return self._run(low.color[lenses[:, 0], lenses[:, 1]], low.scale)

    def _run(self, linear: Array, scale: int) -> Array:
        """(N, h, w, 3) scene-linear -> (N, s·h, s·w, 3) scene-linear."""
        if not len(linear):
            return np.zeros((0, linear.shape[1] * scale, linear.shape[2] * scale, 3), np.float32)
        if scale not in self._engines:
            self._engines[scale] = Engine(load(self.name, scale, self._weights), device=self._device)
        if not np.isfinite(linear).all():
            note = f"{self.name} met NaN or infinite values in its input and replaced them by 0"
            if note not in self.notes:
                self.notes.append(note)
                warnings.warn(note, stacklevel=3)
            linear = np.nan_to_num(linear, nan=0.0, posinf=0.0, neginf=0.0)
        return self._engines[scale](linear)


class WholeEIAUpscaler(PhotographUpscaler):
    """The same over the whole EIA as one image: it shows the crosstalk that per-EI methods avoid.

    The latest rows are cached, because callers ask for few lenses at a time.
    """

    _cache: tuple[LowResEIA, int, Array] | None = None

    def __call__(self, low: LowResEIA, lenses: Array) -> Array:
        """Return the EIs of ``lenses`` (N, 2), cut from whole rows of lenses with enough neighbours above and below."""
        lenses = np.asarray(lenses)
        _, sx, h, w, _ = low.color.shape
        size = (h * low.scale, w * low.scale)
        result = np.empty((len(lenses), *size, 3), np.float32)
        for first in range(0, int(lenses[:, 0].max(initial=-1)) + 1, ROWS_AT_ONCE):
            chosen = (lenses[:, 0] >= first) & (lenses[:, 0] < first + ROWS_AT_ONCE)
            if chosen.any():
                if self._cache is None or self._cache[0] is not low or self._cache[1] != first:
                    self._cache = (low, first, self._rows(low, first))
                rows = self._cache[2].reshape(-1, size[0], sx, size[1], 3)
                result[chosen] = rows[lenses[chosen, 0] - first, :, lenses[chosen, 1]]
        return result

    def _rows(self, low: LowResEIA, first: int) -> Array:
        """Return rows of lenses from ``first`` on, (rows·h·s, sx·w·s, 3), as of the whole EIA."""
        sy, sx, h, w, _ = low.color.shape
        halo = math.ceil(RECEPTIVE_RADIUS / h)
        top, end = max(first - halo, 0), min(first + ROWS_AT_ONCE, sy)
        bottom = min(end + halo, sy)
        strip = low.color[top:bottom].transpose(0, 2, 1, 3, 4).reshape(1, (bottom - top) * h, sx * w, 3)
        start = (first - top) * h * low.scale
        return self._run(strip, low.scale)[0, start:start + (end - first) * h * low.scale]
