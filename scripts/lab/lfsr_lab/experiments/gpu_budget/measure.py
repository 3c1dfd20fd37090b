"""The same steps measured on this machine's best device."""

from __future__ import annotations

import dataclasses
import math
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from lfsr_core.base.arrays import Array
from lfsr_core.commands.sentences import sentence
from lfsr_core.frames.frame import read_frame
from lfsr_core.frames.request import AUTO, GUIDES, Request, Sampling
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.reconstruct.averaging import read_low
from lfsr_core.reconstruct.methods.denoise import denoise_low_resolution
from lfsr_lab.experiments.engine.environment import Environment, environment, load_average
from lfsr_lab.experiments.engine.renders import Store
from lfsr_lab.experiments.gpu_budget.counts import DENOISE, INTERPOLATE, SHOW, TRACE, WEAVE

REPEATS = 7


@dataclasses.dataclass(frozen=True)
class Measured:
    """Milliseconds of a frame's steps on one device."""

    display: str
    scale: int
    spp: int
    device: str  # of Cycles
    tensors: str  # device of PyTorch, which interpolates and weaves
    samples_per_second: float  # by which a render takes longer, without what it takes before the first sample
    started_ms: float  # of a render before the first sample
    milliseconds: dict[str, float]  # by step, medians
    notes: tuple[str, ...]  # of the denoiser
    environment: Environment
    load: float | None  # of the machine


def measure(store: Store, scene: Path, display: DisplayProfile, scale: int, spp: int) -> Measured:
    """Render with ``spp`` and four times as many samples, then time every other step."""
    jobs = [Request(str(store.folder / f"scale-{scale}-spp-{count}"), display, str(scene), sampling=Sampling(scale,
            count),
                layers=GUIDES, device=AUTO) for count in (spp, 4 * spp)]
    store.render_all(jobs)
    frames = [read_frame(job.output) for job in jobs]
    few, many = (frame.seconds["render"] for frame in frames)
    low = read_low(Path(jobs[0].output))
    pixels = math.prod(low.color.shape[:4])
    rate = pixels * 3 * spp / max(many - few, 1e-3)
    device = best_device()
    milliseconds = {TRACE: 1e3 * pixels * spp / rate, DENOISE: median_ms(lambda: denoise_low_resolution(low))}
    notes = tuple(map(sentence, denoise_low_resolution(low).notes))
    with torch.inference_mode():
        milliseconds |= tensor_steps(np.asarray(low.color, np.float32), low.factors, display, device)
    return Measured(display.name, scale, spp, frames[0].device, str(device), rate, max(0.0, 1e3 * few
                    - milliseconds[TRACE]), milliseconds, notes, environment(), load_average())


def tensor_steps(images: Array, factors: tuple[int, int], display: DisplayProfile,
                 device: torch.device) -> dict[str, float]:
    """Milliseconds of what tensors do: interpolation, weave and a copy to the display's buffer.

    ``images``: low-resolution EIs (sy, sx, h, w, 3). ``factors``: by which they grow (horizontal, vertical).
    """
    half = torch.float16 if device.type != "cpu" else torch.float32
    low = torch.from_numpy(images.reshape(-1, *images.shape[2:])).permute(0, 3, 1, 2).to(device, half).contiguous()

    grown = tuple(map(float, factors[::-1]))

    def interpolated() -> torch.Tensor:
        larger = torch.nn.functional.interpolate(low, scale_factor=grown, mode="bilinear", align_corners=False)
        return larger.clamp_(0, 1).mul_(255).to(torch.uint8)

    found = {INTERPOLATE: median_ms(interpolated, device)} if factors != (1, 1) else {}
    shown = torch.zeros((*display.panel_pixels[::-1], 4), dtype=torch.uint8, device=device)
    if display.is_woven:
        finished = interpolated().flatten()
        places = torch.randint(finished.numel(), (shown.numel() * 3 // 4,), device=device)
        found[WEAVE] = median_ms(lambda: finished.take(places), device)
    target = torch.empty_like(shown)
    return {**found, SHOW: median_ms(lambda: target.copy_(shown), device)}


def best_device() -> torch.device:
    """The accelerator of PyTorch, the CPU without one."""
    return torch.accelerator.current_accelerator() or torch.device("cpu")


def median_ms(work: Callable[[], object], device: torch.device | None = None) -> float:
    """Median milliseconds of ``REPEATS`` calls after one that does not count, each until the device has finished."""
    seconds = []
    for _ in range(REPEATS + 1):
        started = time.perf_counter()
        work()
        if device is not None and device.type != "cpu":
            torch.accelerator.synchronize()
        seconds.append(time.perf_counter() - started)
    return 1e3 * statistics.median(seconds[1:])
