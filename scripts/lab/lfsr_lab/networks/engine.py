"""Inference: a comparator on many elemental images, in batches of ``step``.

Small steps stay in a CPU's cache and large ones fill a GPU.
"""

from __future__ import annotations

import copy

import numpy as np
import torch
from torch import Tensor, nn

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_lab.networks.backends import Backend, CudaBackend, CudaGraph, TorchBackend
from lfsr_lab.networks.srgb import srgb_decode, srgb_encode

DEVICES = ("auto", "cpu", "cuda")
# Low-resolution pixels per step, measured best on two CPU cores and on one GPU: 16 and 1296 EIs of 20×20.
PIXELS_PER_STEP = {"cpu": 6_400, "cuda": 518_400}
SMALLEST_STEP, STEP_AFTER_GPU = 8, 64


class Engine:
    """Scene-linear EIs in, scene-linear EIs out, through a network that works on sRGB-encoded ones.

    ``notes`` says what did not go as asked: smaller steps, a fall-back to the CPU.
    """

    def __init__(self, network: nn.Module, backend: Backend, step: int | None) -> None:
        self.notes: list[str] = []
        self.backend, self.step = backend, step
        self._network = network
        self._graphs: dict[tuple[int, ...], CudaGraph] = {}

    def __call__(self, linear: Array) -> Array:
        """(N, h, w, 3) float32 -> (N, s·h, s·w, 3) float32 in [0, 1]."""
        low = torch.from_numpy(np.ascontiguousarray(linear, np.float32))
        return self.run(low).cpu().numpy()

    @torch.inference_mode()
    def run(self, low: Tensor) -> Tensor:
        """The same for tensors; on a GPU the result stays there. Out of memory: smaller steps, then the CPU."""
        if self.step is None:
            pixels = PIXELS_PER_STEP.get(self.backend.device.type, PIXELS_PER_STEP["cpu"])
            self.step = max(1, pixels // (low.shape[1] * low.shape[2]))
        while True:
            try:
                return self._in_steps(low)
            except torch.OutOfMemoryError:
                self._need_less()

    def _in_steps(self, low: Tensor) -> Tensor:
        device, result, start = self.backend.device, None, 0
        for batch in low.split(self.step):
            high = self._apply(self.backend, batch.to(device, non_blocking=True))
            if result is None:
                result = torch.empty(len(low), *high.shape[1:], device=device)
            result[start:start + len(batch)] = high
            start += len(batch)
        return result

    def _apply(self, backend: Backend, low: Tensor) -> Tensor:
        """(n, h, w, 3) linear -> (n, s·h, s·w, 3) linear, both on the backend's device."""
        if backend.device.type != "cuda":
            return _through(backend, low)
        # Few sizes of graph: the last batch is filled up to a power of two.
        size = min(self.step or len(low), 1 << (len(low) - 1).bit_length())
        size = max(size, len(low))
        padded = torch.cat([low, low.new_zeros(size - len(low), *low.shape[1:])]) if size > len(low) else low
        key = tuple(padded.shape)
        if key not in self._graphs:
            self._graphs[key] = CudaGraph(lambda x: _through(backend, x), padded)
        return self._graphs[key](padded)[:len(low)]

    def _need_less(self) -> None:
        """After out-of-memory: half the step, then the CPU; LfsrError where that failed too."""
        self._graphs.clear()
        if torch.cuda.is_available():
            torch.cuda.empty_cache()
        if self.step > SMALLEST_STEP:
            self.step //= 2
            self._note(f"out of memory: {self.step} elemental images per step instead of {self.step * 2}")
        elif self._is_gpu():
            self.backend, self.step = TorchBackend(self._network), STEP_AFTER_GPU
            self._note("out of memory on the GPU even with small steps: the CPU was used")
        else:
            raise LfsrError(f"out of memory with {self.step} elemental images per step: close other programs")

    def _is_gpu(self) -> bool:
        return self.backend.device.type == "cuda"

    def _note(self, note: str) -> None:
        if note not in self.notes:
            self.notes.append(note)


def make_engine(network: nn.Module, *, device: str = "auto", step: int | None = None) -> Engine:
    """Engine for a network; ``device`` "auto" is the GPU where there is one.

    ``step``: elemental images per call, None for as many as PIXELS_PER_STEP says.
    LfsrError for an unknown or absent device, or a step below 1.
    """
    if device not in DEVICES:
        raise LfsrError(f"device {device!r} is unknown: choose one of {', '.join(DEVICES)}")
    if step is not None and step < 1:
        raise LfsrError(f"step {step} is no number of elemental images: choose 1 or more, or leave it out")
    if device == "cuda" and not torch.cuda.is_available():
        raise LfsrError("device 'cuda' is not available on this machine: choose cpu or auto")
    network = copy.deepcopy(network).cpu().eval()
    on_gpu = device != "cpu" and torch.cuda.is_available()
    return Engine(network, CudaBackend(network) if on_gpu else TorchBackend(network), step)


def _through(backend: Backend, low: Tensor) -> Tensor:
    high = backend(srgb_encode(low).permute(0, 3, 1, 2)).permute(0, 2, 3, 1)
    return srgb_decode(high.float())
