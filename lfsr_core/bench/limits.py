"""What a device can do at best, measured: the lines of a roofline."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import torch

COPY_BYTES = {"cuda": 1 << 31, "cpu": 1 << 27}
MATMUL_SIDE = {"cuda": 8192, "cpu": 1536}


def timed(function: Callable[[], object], device: torch.device, repeats: int,
          before: Callable[[], object] | None = None, warm_up: int = 3) -> list[float]:
    """Seconds of each of ``repeats`` calls, after ``warm_up`` ones; ``before`` runs untimed ahead of every call."""
    for _ in range(warm_up):
        function()
    return [_once(function, device, before) for _ in range(repeats)]


def _once(function: Callable[[], object], device: torch.device, before: Callable[[], object] | None) -> float:
    if before:
        before()
    if device.type != "cuda":
        started = time.perf_counter()
        function()
        return time.perf_counter() - started
    start, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
    torch.cuda.synchronize()
    start.record()
    function()
    end.record()
    end.synchronize()
    return start.elapsed_time(end) / 1e3


def copy_bandwidth(device: torch.device) -> float:
    """Bytes per second of a large copy on the device, read and written bytes both counted."""
    source = torch.randint(0, 255, (COPY_BYTES[device.type],), dtype=torch.uint8, device=device)
    target = torch.empty_like(source)
    return 2 * len(source) / statistics.median(timed(lambda: target.copy_(source), device, 10))


def matmul_rate(device: torch.device, dtype: torch.dtype) -> float:
    """Multiply-adds per second of a large matrix product of random values."""
    side = MATMUL_SIDE[device.type]
    a, b = (torch.randn(side, side, device=device).to(dtype) for _ in range(2))
    return side**3 / statistics.median(timed(lambda: a @ b, device, 10))


def measure(device: torch.device) -> dict[str, float]:
    """Copy bandwidth and the matrix rates in the types that networks run in."""
    dtypes = {"float16": torch.float16} if device.type == "cuda" else {"float32": torch.float32}
    rates = {f"multiply_adds_per_second_{name}": matmul_rate(device, dtype) for name, dtype in dtypes.items()}
    return {"bytes_per_second": copy_bandwidth(device), **rates}


def arithmetic_rate(ceiling: dict[str, float]) -> float:
    """Multiply-adds per second of what ``measure`` gave."""
    return next(value for key, value in ceiling.items() if key.startswith("multiply_adds"))


def summary(seconds: list[float]) -> dict[str, float]:
    """Median and quartiles in milliseconds, and frames per second at the median."""
    low, middle, high = (1e3 * value for value in statistics.quantiles(seconds, n=4))
    return {"ms": middle, "ms_quartile_1": low, "ms_quartile_3": high, "runs": len(seconds),
            "frames_per_second": 1e3 / middle}
