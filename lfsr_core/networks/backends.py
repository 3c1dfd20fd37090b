"""Ways to run one network on batches of elemental images.

A backend takes and gives (N, 3, h, w) and (N, 3, s·h, s·w) tensors on its own
device. Measured on 2 Zen 3 cores (AVX2, no bf16), CPU time at 8K, every EI of
20×20, s = 4: the paper's generator 2.6 s as published in torch, 1.1 s with its
deconvolution folded and channels last, 0.90 s in ONNX Runtime, 0.87 s in
OpenVINO; ESPCN 2.7, 2.0 and 2.5 s; three 16-channel layers 0.78, 0.66 and
0.61 s. So ONNX Runtime runs on CPUs and torch where it is missing, on GPUs, and
where a CPU computes in bf16; OpenVINO is not worth a third engine.
"""

from __future__ import annotations

import copy
import io
import warnings
from collections.abc import Callable
from typing import Protocol

import torch
from torch import Tensor, nn

from lfsr_core.networks.layers import fold_for_inference

CPU = torch.device("cpu")
WARM_UP_RUNS = 3


class Backend(Protocol):
    """``device``: where batches go; ``name``: as in ``engine=``."""

    name: str
    device: torch.device

    def __call__(self, low: Tensor) -> Tensor: ...


class TorchBackend:
    """Torch on the CPU, channels last, in float32 or bfloat16."""

    device = CPU

    def __init__(self, network: nn.Module, dtype: torch.dtype = torch.float32) -> None:
        self.name = "torch" if dtype == torch.float32 else "torch-bf16"
        self._network = prepared(network, CPU, dtype)
        self._dtype = dtype

    def __call__(self, low: Tensor) -> Tensor:
        low = low.to(self._dtype, memory_format=torch.channels_last)
        return self._network(low).float()


class OnnxBackend:
    """ONNX Runtime on the CPU."""

    name, device = "onnx", CPU

    def __init__(self, network: nn.Module) -> None:
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = torch.get_num_threads()
        # Idle workers sleep: between batches the cores belong to others.
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        self._session = onnxruntime.InferenceSession(onnx_bytes(network), options, providers=["CPUExecutionProvider"])

    def __call__(self, low: Tensor) -> Tensor:
        return torch.from_numpy(self._session.run(None, {"low": low.contiguous().numpy()})[0])


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


def onnx_bytes(network: nn.Module) -> bytes:
    """ONNX model of the folded network: "low" (N, 3, h, w) -> "high", N, h and w free."""
    folded = fold_for_inference(copy.deepcopy(network).cpu().float())
    buffer, example = io.BytesIO(), torch.zeros(2, 3, 8, 8)
    free = {0: "n", 2: "rows", 3: "columns"}
    with warnings.catch_warnings():
        # The exporter that needs no further package is announced as old on every call.
        warnings.simplefilter("ignore", DeprecationWarning)
        torch.onnx.export(folded, (example,), buffer, input_names=["low"], output_names=["high"],
                          dynamic_axes={"low": free, "high": free}, dynamo=False)
    return buffer.getvalue()


def cpu_has_bf16() -> bool:
    """True where the CPU multiplies bfloat16 itself; elsewhere it is emulated and over ten times slower."""
    asks = ("_is_avx512_bf16_supported", "_is_amx_tile_supported")
    return any(getattr(torch.cpu, name, bool)() for name in asks)
