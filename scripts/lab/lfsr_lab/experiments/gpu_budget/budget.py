"""Milliseconds of each step at published rates, and what fits into a frame."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Sequence
from pathlib import Path

from lfsr_core.optics.display import DisplayProfile
from lfsr_lab.experiments.gpu_budget.counts import TRACE, Work, frame_work

GPUS = Path(__file__).with_name("gpus.toml")
FRAME_MS = 1000 / 30  # the paper's 33 ms


@dataclasses.dataclass(frozen=True)
class GPU:
    """Published rates of a GPU."""

    name: str
    samples_per_second: tuple[float, float]  # lowest and highest
    half_tflops: float
    gigabytes_per_second: float
    sources: tuple[str, ...]

    def least_ms(self, work: Work) -> tuple[float, float]:
        """Least milliseconds of a step, at the highest and at the lowest rate of samples.

        A step waits for its samples, its arithmetic or its memory, whichever takes longest.
        """
        fixed = max(work.operations / (self.half_tflops * 1e12), work.bytes / (self.gigabytes_per_second * 1e9))
        lowest, highest = (1e3 * max(fixed, work.samples / rate) for rate in reversed(self.samples_per_second))
        return lowest, highest

    def limit(self, work: Work) -> str:
        """What a step waits for."""
        seconds = {"samples": work.samples / self.samples_per_second[1],
                   "arithmetic": work.operations / (self.half_tflops * 1e12),
                   "memory": work.bytes / (self.gigabytes_per_second * 1e9)}
        return max(seconds, key=seconds.__getitem__)


def read_gpus() -> list[GPU]:
    """Published rates."""
    found = tomllib.loads(GPUS.read_text(encoding="utf-8"))["gpu"]
    return [GPU(**{**fields, "samples_per_second": tuple(fields["samples_per_second"]),
                   "sources": tuple(fields["sources"])}) for fields in found]


def frame_ms(gpu: GPU, steps: Sequence[Work]) -> tuple[float, float]:
    """Least milliseconds of a whole frame, its steps one after another."""
    each = [gpu.least_ms(work) for work in steps]
    return sum(low for low, _ in each), sum(high for _, high in each)


def fitting_samples(gpu: GPU, display: DisplayProfile, scale: int) -> tuple[float, float]:
    """Samples per rendered pixel that fit into a frame beside the other steps, at the lowest and highest rate."""
    steps = frame_work(display, scale, 1)
    left = FRAME_MS - sum(gpu.least_ms(work)[0] for work in steps if work.step != TRACE)
    pixels = next(work.samples for work in steps if work.step == TRACE)
    low, high = (max(0.0, left / 1e3 * rate / pixels) for rate in gpu.samples_per_second)
    return low, high
