"""How long every network takes for one 8K frame with every EI in the foreground.

``python -m lfsr_core.bench.second_stage --device cuda --json OUT``: needs torch and
numpy only. A frame starts as the low-resolution EIA on the device, scene-linear
half floats, (N, h, w, 3), and ends as the 8K image on the device, 8-bit sRGB in
lens order. Networks without weights run with random ones: speed does not depend on them.
"""

from __future__ import annotations

import argparse
import copy
import importlib.util
import platform
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn

from lfsr_core import networks
from lfsr_core.bench import layers, limits
from lfsr_core.errors import LfsrError
from lfsr_core.files import write_json
from lfsr_core.networks.backends import Backend, CudaGraph, OnnxBackend, TorchBackend
from lfsr_core.networks.count import multiply_adds, parameters
from lfsr_core.networks.fused import BytePhases, write_bytes

POISON = 0xAB
TOLERANCE_8_BIT = 3
WARM_UP_RUNS = {"cpu": 1, "cuda": 3}
CUDA_PARTS, CPU_STEPS = (1, 3, 9, 27), (96, 384)
Runner = Callable[[Tensor], Tensor]


@dataclass(frozen=True)
class Workload:
    """An 8K frame: ``lenses`` (sx, sy), low-resolution EIs of ``side``² pixels, scale ``scale``."""

    lenses: tuple[int, int]
    side: int
    scale: int = 4

    @property
    def count(self) -> int:
        return self.lenses[0] * self.lenses[1]


WORKLOADS = {"8k-20x20": Workload((96, 54), 20), "8k-10x10": Workload((192, 108), 10)}


def encode(linear: Tensor) -> Tensor:
    """sRGB curve in the input's type."""
    linear = linear.clamp(0, 1)
    return torch.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear.clamp_min(0.0031308) ** (1 / 2.4) - 0.055)


def stage(network: Callable[[Tensor], Tensor], low: Tensor, parts: int, load: Workload, image: Tensor) -> Tensor:
    """Whole second stage in ``parts`` calls of a BytePhases ``network``: encode, network, bytes into ``image``."""
    rows = -(-load.lenses[1] // parts)
    block, height = rows * load.lenses[0], rows * load.side * load.scale
    for index, batch in enumerate(low.split(block)):
        phases = network(encode(batch).permute(0, 3, 1, 2))
        write_bytes(phases, image[index * height:(index + 1) * height], load.lenses[0], load.scale)
    return image


def measure(name: str, load: Workload, device: torch.device, repeats: int, ceiling: dict[str, float]) -> dict[str, Any]:
    """Figures of one network on one workload, for its fastest variant, with all variants listed."""
    torch.manual_seed(0)
    trained = load.scale in networks.trained_scales(name)
    network = (networks.load if trained else networks.build)(name, load.scale).eval().requires_grad_(False)
    low = torch.rand(load.count, load.side, load.side, 3, device=device)
    expected = _reference(network, low, load)
    variants = [_variant(run, expected, load, device, repeats, facts)
                for facts, run in _variants(network, low, load, device)]
    best = dict(min(variants, key=lambda variant: variant["ms"]))
    cost = multiply_adds(BytePhases(network, load.scale), load.side, load.side)
    bound = _bound(network, low, load, cost, ceiling)
    kernels = layers.kernel_times(best.pop("run"), device)
    for variant in variants:
        variant.pop("run", None)
    return {"network": name, "parameters": parameters(network),
            "multiply_adds_per_low_pixel": multiply_adds(network, load.side, load.side),
            "multiply_adds_per_low_pixel_folded": cost, **best, **bound,
            "times_over_bound": best["ms"] / max(bound["ms_bound_memory"], bound["ms_bound_arithmetic"]),
            "layers": layers.layer_bounds(BytePhases(network, load.scale), load.count, load.side, ceiling),
            "kernels": kernels, "variants": variants}


def _variants(network: nn.Module, low: Tensor, load: Workload,
              device: torch.device) -> Iterator[tuple[dict[str, Any], Runner]]:
    """(facts, function of an image buffer) of every way to run the network on this device."""
    phases = BytePhases(network, load.scale)
    if device.type == "cuda":
        for layout, parts in ((torch.channels_last, CUDA_PARTS), (torch.contiguous_format, CUDA_PARTS[1:2])):
            laid = copy.deepcopy(phases).to(device, torch.float16).to(memory_format=layout)
            for part in parts:
                facts = {"engine": "CUDA graph, half", "parts": part, "layout": str(layout).removeprefix("torch.")}
                yield facts, _captured(laid, low.half(), part, load, layout)
        return
    for backend in _cpu_backends(phases):
        for step in CPU_STEPS:
            parts = min(load.lenses[1], max(1, load.count // step))
            yield {"engine": backend.name, "parts": parts}, _on_cpu(backend, low, parts, load)


def _cpu_backends(phases: BytePhases) -> list[Backend]:
    if importlib.util.find_spec("onnxruntime"):
        return [TorchBackend(phases), OnnxBackend(phases)]
    print("ONNX Runtime is not installed: torch only", file=sys.stderr)
    return [TorchBackend(phases)]


def _on_cpu(backend: Backend, low: Tensor, parts: int, load: Workload) -> Runner:
    return lambda image: stage(backend, low, parts, load, image)


def _captured(module: nn.Module, low: Tensor, parts: int, load: Workload, layout: torch.memory_format) -> Runner:
    """The stage as one CUDA graph that writes into the image it is first given."""
    graphs: dict[int, CudaGraph] = {}

    def network(x: Tensor) -> Tensor:
        return module(x.contiguous(memory_format=layout))

    def run(image: Tensor) -> Tensor:
        key = image.data_ptr()
        if key not in graphs:
            graphs[key] = CudaGraph(lambda x: stage(network, x, parts, load, image), low)
        graphs[key].replay()
        return image

    return run


def _variant(run: Callable[[Tensor], Tensor], expected: Tensor, load: Workload, device: torch.device, repeats: int,
             facts: dict[str, Any]) -> dict[str, Any]:
    """Times of one variant; LfsrError if it leaves a pixel unwritten or wrong."""
    side = load.side * load.scale
    image = torch.empty(load.lenses[1] * side, load.lenses[0] * side, 3, dtype=torch.uint8, device=device)
    seconds = limits.timed(lambda: run(image), device, repeats, before=lambda: image.fill_(POISON),
                           warm_up=WARM_UP_RUNS[device.type])
    got = image[:side].reshape(side, load.lenses[0], side, 3).transpose(0, 1).int()
    worst = int((got - expected).abs().max())
    last = image[-side:, -side:]
    if worst > TOLERANCE_8_BIT or bool((last == POISON).all()):
        raise LfsrError(f"benchmark variant {facts} is off by {worst} of 255, expected at most {TOLERANCE_8_BIT}")
    return {**facts, **limits.summary(seconds), "worst_error_8_bit": worst, "run": lambda: run(image)}


def _reference(network: nn.Module, low: Tensor, load: Workload) -> Tensor:
    """First row of EIs through the network as built, in single precision, as 8-bit values."""
    first = low[:load.lenses[0]].half().float() if low.is_cuda else low[:load.lenses[0]]
    with torch.inference_mode():
        high = copy.deepcopy(network).to(low.device)(encode(first).permute(0, 3, 1, 2))
    return high.clamp(0, 1).mul(255).add(0.5).to(torch.uint8).permute(0, 2, 3, 1).int()


def _bound(network: nn.Module, low: Tensor, load: Workload, cost: float, ceiling: dict[str, float]) -> dict[str, float]:
    """Least possible milliseconds: compulsory bytes (frame in, image out, weights) and arithmetic."""
    pixels = load.count * load.side**2
    width = 2 if low.is_cuda else 4
    traffic = pixels * 3 * width + pixels * load.scale**2 * 3 + parameters(network) * width
    return {"bytes_compulsory": traffic, "ms_bound_memory": 1e3 * traffic / ceiling["bytes_per_second"],
            "ms_bound_arithmetic": 1e3 * pixels * cost / limits.arithmetic_rate(ceiling)}


def main(argv: Sequence[str] | None = None) -> int:
    """Print one line per network and workload and write everything as JSON."""
    arguments = _parser().parse_args(argv)
    device = torch.device(arguments.device)
    torch.backends.cudnn.benchmark = True
    report = {"device": torch.cuda.get_device_name() if device.type == "cuda" else platform.machine(),
              "torch": torch.__version__, "threads": torch.get_num_threads(), "limits": limits.measure(device),
              "results": []}
    print(f"{report['device']}: {report['limits']}", flush=True)
    for load_name in arguments.workloads.split(","):
        for name in arguments.methods.split(","):
            with torch.inference_mode():
                row = measure(name, WORKLOADS[load_name], device, arguments.repeats, report["limits"])
            report["results"].append({"workload": load_name, **row})
            print(f"{load_name} {name:10} {row['ms']:9.3f} ms ({row['ms_quartile_1']:.3f} to "
                  f"{row['ms_quartile_3']:.3f}) {row['frames_per_second']:8.1f} fps, "
                  f"{row['times_over_bound']:.1f} × the bound, {row['parts']} parts", flush=True)
            write_json(arguments.json, report)
    return 0


def _parser() -> argparse.ArgumentParser:
    names = [name for name, entry in networks.NETWORKS.items() if entry.upscaler == networks.PHOTOGRAPH_UPSCALER]
    parser = argparse.ArgumentParser(prog="second_stage", description="Time networks on whole 8K frames.")
    parser.add_argument("--device", default="cpu", choices=("cpu", "cuda"))
    parser.add_argument("--methods", default=",".join(names), help="comma-separated networks")
    parser.add_argument("--workloads", default=",".join(WORKLOADS), help="comma-separated, default both")
    parser.add_argument("--repeats", type=int, default=20)
    parser.add_argument("--json", default="out/second-stage.json")
    return parser


if __name__ == "__main__":
    sys.exit(main())
