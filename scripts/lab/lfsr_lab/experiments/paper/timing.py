"""Times that can be compared: the rivals take turns, so that what else the machine does hits all alike."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from lfsr_lab.experiments.paper.records import NetworkTimes, Seconds
from lfsr_lab.experiments.paper.settings import Settings


def take_turns(functions: Mapping[str, Callable[[], Any]], repeats: int) -> Seconds:
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
    return {name: tuple(times) for name, times in seconds.items()}


def median_ms(seconds: Sequence[float]) -> float:
    """Median in milliseconds."""
    return 1e3 * statistics.median(seconds)


def network_times(settings: Settings, networks: Mapping[str, Any], steps: Mapping[str, int]) -> NetworkTimes:
    """Seconds of torch modules on random pixels, scene-linear floats in and out as in the second stage.

    ``networks`` and elemental images per call, ``steps``, by name; how many of which size is in the settings.
    """
    import torch

    from lfsr_lab.networks.engine import make_engine

    count, side = settings.workload
    low = torch.rand(count, side, side, 3, generator=torch.Generator().manual_seed(0))
    on_gpu = torch.cuda.is_available() and settings.device != "cpu"
    engines = {name: make_engine(network, device=settings.device, step=steps[name])
               for name, network in networks.items()}
    low = low.cuda() if on_gpu else low

    def run(name: str) -> None:
        engines[name].run(low)
        if on_gpu:
            torch.cuda.synchronize()

    seconds = take_turns({name: lambda name=name: run(name) for name in engines}, settings.repeats)
    return NetworkTimes(seconds=seconds, engine="cuda" if on_gpu else "torch", threads=torch.get_num_threads(),
                        device=torch.cuda.get_device_name() if on_gpu else "CPU")
