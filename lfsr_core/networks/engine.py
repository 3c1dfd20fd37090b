"""Inference: a network on many elemental images, in batches of ``step``.

Small steps stay in a CPU's cache and large ones fill a GPU, so the step is
measured per machine unless it is given.
"""

from __future__ import annotations

import copy
import importlib.util

import numpy as np
import torch
from torch import Tensor, nn

from lfsr_core.errors import LfsrError
from lfsr_core.networks import backends as runners
from lfsr_core.networks.backends import Backend, CudaGraph
from lfsr_core.networks.calibration import choose

ENGINES = ("auto", "torch", "torch-bf16", "onnx", "cuda")
SMALLEST_STEP = 8


class Engine:
    """Scene-linear EIs in, scene-linear EIs out, through a network that works on sRGB-encoded ones.

    ``notes`` says what did not go as asked: smaller steps, a fall-back to the CPU.
    """

    def __init__(self, network: nn.Module, candidates: list[Backend], step: int | None) -> None:
        self.notes: list[str] = []
        self.backend: Backend | None = None
        self.step = step
        self._network, self._candidates = network, candidates
        self._chosen_for: tuple[int, ...] | None = None
        self._graphs: dict[tuple[int, ...], CudaGraph] = {}
        self._asked_step = step

    def __call__(self, linear: np.ndarray) -> np.ndarray:
        """(N, h, w, 3) float32 -> (N, s·h, s·w, 3) float32 in [0, 1]."""
        low = torch.from_numpy(np.ascontiguousarray(linear, np.float32))
        return self.run(low).cpu().numpy()

    @torch.inference_mode()
    def run(self, low: Tensor) -> Tensor:
        """The same for tensors; on a GPU the result stays there. Out of memory: smaller steps, then the CPU."""
        self._choose(low)
        while True:
            try:
                return self._in_steps(low)
            except torch.OutOfMemoryError:
                self._need_less()

    def _choose(self, low: Tensor) -> None:
        """Backend and step for this size of EI; measured unless there is no choice."""
        if self._chosen_for == low.shape[1:]:
            return
        if len(self._candidates) == 1 and self._asked_step:
            self.backend, self.step = self._candidates[0], self._asked_step
        else:
            identity = f"{type(self._network).__name__} {[tuple(p.shape) for p in self._network.parameters()]}"
            self.backend, self.step = choose(self._candidates, self._apply, low[:1], identity, self._asked_step)
        self._chosen_for = low.shape[1:]

    def _in_steps(self, low: Tensor) -> Tensor:
        assert self.backend is not None and self.step
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
            self._say(f"out of memory: {self.step} elemental images per step instead of {self.step * 2}")
        elif self._is_gpu():
            self.backend, self.step = runners.TorchBackend(self._network), 64
            self._say("out of memory on the GPU even with small steps: the CPU was used")
        else:
            raise LfsrError(f"out of memory with {self.step} elemental images per step: close other programs")

    def _is_gpu(self) -> bool:
        return self.backend is not None and self.backend.device.type == "cuda"

    def _say(self, note: str) -> None:
        if note not in self.notes:
            self.notes.append(note)


def make_engine(network: nn.Module, *, device: str = "auto", engine: str = "auto", step: int | None = None) -> Engine:
    """Engine for a network in evaluation mode; ``step``: EIs per call, None is measured.

    LfsrError for an unknown engine, an absent package or device, or a step below 1.
    """
    if engine not in ENGINES:
        raise LfsrError(f"engine {engine!r} is unknown: choose {', '.join(ENGINES)}")
    if step is not None and step < 1:
        raise LfsrError(f"step {step} is no number of elemental images: choose 1 or more, or leave it out")
    network = copy.deepcopy(network).cpu().eval()
    names = _usable(device) if engine == "auto" else [engine]
    return Engine(network, [_backend(name, network) for name in names], step)


def _usable(device: str) -> list[str]:
    """Backends to choose from on this machine."""
    cuda = torch.cuda.is_available()
    if device == "cuda" and not cuda:
        raise LfsrError("device 'cuda' is not available on this machine: choose cpu or auto")
    if device not in ("auto", "cpu", "cuda"):
        raise LfsrError(f"device {device!r} is unknown: choose cpu, cuda or auto")
    if cuda and device != "cpu":
        return ["cuda"]
    extra = [*(["onnx"] if importlib.util.find_spec("onnxruntime") else []),
             *(["torch-bf16"] if runners.cpu_has_bf16() else [])]
    return ["torch", *extra]


def _backend(name: str, network: nn.Module) -> Backend:
    if name == "onnx":
        if importlib.util.find_spec("onnxruntime") is None:
            raise LfsrError("engine 'onnx' needs the Python package onnxruntime: install it or choose torch")
        return runners.OnnxBackend(network)
    if name == "cuda":
        if not torch.cuda.is_available():
            raise LfsrError("engine 'cuda' has no CUDA device on this machine: choose torch or onnx")
        return runners.CudaBackend(network)
    return runners.TorchBackend(network, torch.bfloat16 if name == "torch-bf16" else torch.float32)


def _through(backend: Backend, low: Tensor) -> Tensor:
    high = backend(_encode(low).permute(0, 3, 1, 2)).permute(0, 2, 3, 1)
    return _decode(high.float())


def _encode(linear: Tensor) -> Tensor:
    """sRGB curve of values clipped to [0, 1]."""
    linear = linear.clamp(0, 1)
    return torch.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear.clamp_min(0.0031308) ** (1 / 2.4) - 0.055)


def _decode(encoded: Tensor) -> Tensor:
    """Inverse of the sRGB curve, clipped to [0, 1]."""
    encoded = encoded.clamp(0, 1)
    return torch.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
