"""A network layer by layer against the device's limits, and the kernels that really ran."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor, nn

from lfsr_core.bench.limits import arithmetic_rate
from lfsr_core.networks.count import layer_multiply_adds

PROFILED_RUNS, LISTED_KERNELS = 5, 12


def layer_bounds(network: nn.Module, count: int, side: int, ceiling: dict[str, float]) -> list[dict[str, Any]]:
    """Least milliseconds of each convolution for ``count`` EIs of ``side``²: its tensors read and written once
    in half precision (single on a CPU), and its multiply-adds at the matrix rate."""
    rows: list[dict[str, Any]] = []
    width = 2 if "multiply_adds_per_second_float16" in ceiling else 4

    def note(layer: nn.Module, arguments: tuple[Tensor, ...], output: Tensor) -> None:
        work = count * layer_multiply_adds(layer, arguments[0], output)
        traffic = count * width * (arguments[0].numel() + output.numel())
        rows.append({"layer": str(layer), "multiply_adds": work, "bytes": traffic,
                     "ms_bound_memory": 1e3 * traffic / ceiling["bytes_per_second"],
                     "ms_bound_arithmetic": 1e3 * work / arithmetic_rate(ceiling)})

    convolutions = [layer for layer in network.modules() if isinstance(layer, (nn.Conv2d, nn.ConvTranspose2d))]
    hooks = [layer.register_forward_hook(note) for layer in convolutions]
    network(torch.zeros(1, 3, side, side))
    for hook in hooks:
        hook.remove()
    return rows


def kernel_times(run: Callable[[], object], device: torch.device) -> list[dict[str, Any]]:
    """Milliseconds per run of the longest CUDA kernels of ``run``; nothing on a CPU."""
    if device.type != "cuda":
        return []
    with torch.profiler.profile(activities=[torch.profiler.ProfilerActivity.CUDA]) as profile:
        for _ in range(PROFILED_RUNS):
            run()
        torch.cuda.synchronize()
    spent: dict[str, list[float]] = defaultdict(list)
    for event in profile.events():
        if event.device_type == torch.autograd.DeviceType.CUDA:
            spent[event.name].append(event.time_range.elapsed_us() / 1e3)
    longest = sorted(spent.items(), key=lambda item: -sum(item[1]))[:LISTED_KERNELS]
    return [{"kernel": name[:200], "ms_per_run": sum(times) / PROFILED_RUNS, "launches": len(times) / PROFILED_RUNS}
            for name, times in longest]
