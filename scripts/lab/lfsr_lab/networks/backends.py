"""Ways to run one comparator on batches of elemental images.

A backend takes and gives (N, 3, h, w) and (N, 3, s·h, s·w) tensors on its own
device. ONNX Runtime and OpenVINO were measured too, on two Zen 3 cores at 8K: the
paper's generator 0.90 and 0.87 s against torch's 1.1 s with its deconvolution folded
and channels last. Comparators are not worth a second engine for that.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Protocol

import torch
from torch import Tensor, nn

from lfsr_lab.networks.deconvolution import fold_for_inference

CPU = torch.device("cpu")
WARM_UP_RUNS = 3


class Backend(Protocol):
    """``device``: where batches go; ``name``: as in ``engine=``."""

    name: str
    device: torch.device

    def __call__(self, low: Tensor) -> Tensor: ...


class TorchBackend:
    """Torch on the CPU, channels last."""

    name, device = "torch", CPU

    def __init__(self, network: nn.Module) -> None:
        self._network = prepared(network, CPU, torch.float32)

    def __call__(self, low: Tensor) -> Tensor:
        return self._network(low.to(memory_format=torch.channels_last))


class CudaBackend:
    """Torch on a CUDA device: half precision, channels last."""

    name = "cuda"

    def __init__(self, network: nn.Module, device: torch.device | None = None) -> None:
        self.device = device or torch.device("cuda")
        self._network = prepared(network, self.device, torch.float16)

    def __call__(self, low: Tensor) -> Tensor:
        return self._network(low.to(torch.float16, memory_format=torch.channels_last))


class CudaGraph:
    """A function of one tensor of a fixed shape, captured once: replaying it costs one launch."""

    def __init__(self, function: Callable[[Tensor], Tensor], example: Tensor) -> None:
        self._input = example.clone()
        side = torch.cuda.Stream()
        side.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(side):
            for _ in range(WARM_UP_RUNS):
                function(self._input)
        torch.cuda.current_stream().wait_stream(side)
        self._graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(self._graph):
            self._output = function(self._input)

    def __call__(self, x: Tensor) -> Tensor:
        """Result of the captured function; overwritten by the next call."""
        self._input.copy_(x)
        return self.replay()

    def replay(self) -> Tensor:
        """The same on what the input held last."""
        self._graph.replay()
        return self._output


def prepared(network: nn.Module, device: torch.device, dtype: torch.dtype) -> nn.Module:
    """A folded copy for inference, channels last."""
    folded = fold_for_inference(copy.deepcopy(network))
    return folded.to(device, dtype).to(memory_format=torch.channels_last).requires_grad_(False)
