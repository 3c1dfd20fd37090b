"""Run a comparator on many elemental images, in batches of ``step``.

Small steps stay in a CPU's cache and large ones fill a GPU.
"""

from __future__ import annotations

import copy

import numpy as np
import torch
from torch import Tensor, nn

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_lab.networks.deconvolution import fold_for_inference
from lfsr_lab.networks.srgb import srgb_decode, srgb_encode

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
        return torch.cat([self._apply(batch.to(self.device, non_blocking=True)) for batch in low.split(step)])

    def _apply(self, low: Tensor) -> Tensor:
        encoded = srgb_encode(low).permute(0, 3, 1, 2).to(self._dtype, memory_format=torch.channels_last)
        return srgb_decode(self._network(encoded).permute(0, 2, 3, 1).float())


def choose_device(name: str) -> torch.device:
    """Return the device "cpu", "cuda" or "auto"; LfsrError for another name, or if CUDA is absent."""
    if name not in DEVICES:
        raise LfsrError(f"device is {name!r}, but it must be one of {', '.join(DEVICES)}")
    on_gpu = name != "cpu" and torch.cuda.is_available()
    if name == "cuda" and not on_gpu:
        raise LfsrError("device 'cuda' is not available on this machine: choose cpu or auto")
    return torch.device("cuda" if on_gpu else "cpu")
