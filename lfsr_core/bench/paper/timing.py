"""Times that can be compared: the rivals take turns, so that what else the machine does hits all alike."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any


def take_turns(functions: Mapping[str, Callable[[], Any]], repeats: int) -> dict[str, list[float]]:
    """Seconds of every call, ``repeats`` per function in turn, after one call each that does not count.

    A function must return only when its work is done.
    """
    for function in functions.values():
        function()
    seconds: dict[str, list[float]] = {name: [] for name in functions}
    for _ in range(repeats):
        for name, function in functions.items():
            started = time.perf_counter()
            function()
            seconds[name].append(round(time.perf_counter() - started, 6))
    return seconds


def median_ms(seconds: Sequence[float]) -> float:
    """Median in milliseconds."""
    return 1e3 * statistics.median(seconds)


def network_times(networks: Mapping[str, Any], workload: tuple[int, int], repeats: int, device: str,
                  steps: Mapping[str, int]) -> dict[str, Any]:
    """Seconds of untrained or trained torch modules on ``workload`` (elemental images, side) of random pixels.

    ``steps``: elemental images per call, for each name. Scene-linear floats in and
    out, as the second stage runs them. Also names the engine and the device.
    """
    import torch

    from lfsr_core.reconstruct.networks.pytorch.engine import make_engine

    count, side = workload
    low = torch.rand(count, side, side, 3, generator=torch.Generator().manual_seed(0))
    on_gpu = torch.cuda.is_available() and device != "cpu"
    engines = {name: make_engine(network, device=device, step=steps[name])
               for name, network in networks.items()}
    low = low.cuda() if on_gpu else low

    def run(name: str) -> None:
        engines[name].run(low)
        if on_gpu:
            torch.cuda.synchronize()

    seconds = take_turns({name: lambda name=name: run(name) for name in engines}, repeats)
    return {"seconds": seconds, "engine": "cuda" if on_gpu else "torch", "threads": torch.get_num_threads(),
            "device": torch.cuda.get_device_name() if on_gpu else "CPU"}
