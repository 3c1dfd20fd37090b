"""Exact counts of one frame: samples, arithmetic operations and bytes of each step, all of it on one GPU."""

from __future__ import annotations

import dataclasses
import functools
import math
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

from lfsr_core.optics.display import DisplayProfile
from lfsr_core.reconstruct.methods.denoise import INPUT, LAYERS, SKIPS, WEIGHTS, network_shapes
from lfsr_lab.networks.tza import read_tza

TRACE, DENOISE, INTERPOLATE, WEAVE, SHOW = "path tracing", "denoising", "interpolation", "weave", "display"
HALF, FLOAT, BYTES_PER_PIXEL = 2, 4, 4  # bytes of a number in the network, of one in the render, of a shown pixel
LAYER_CHANNELS = 4 + 3 + 3  # colour with opacity, albedo, normal
TAPS = 2  # of linear interpolation along one axis
INDEX = 4  # bytes that say where a subpixel's value stands
DEPTHS = {name: depth for depth, names in enumerate((
    ("enc_conv0", "enc_conv1", "dec_conv1a", "dec_conv1b", "dec_conv0"), ("enc_conv2", "dec_conv2a", "dec_conv2b"),
    ("enc_conv3", "dec_conv3a", "dec_conv3b"), ("enc_conv4", "dec_conv4a", "dec_conv4b"), ("enc_conv5a", "enc_conv5b")))
    for name in names}
"""How often the image was halved, by layer of the network."""


@dataclasses.dataclass(frozen=True)
class Work:
    step: str
    samples: int = 0  # paths from the camera
    operations: int = 0  # additions and multiplications
    bytes: int = 0  # read from and written to the GPU's memory

    def __add__(self, other: Work) -> Work:
        return Work(self.step, self.samples + other.samples, self.operations + other.operations,
                    self.bytes + other.bytes)


def frame_work(display: DisplayProfile, scale: int, spp: int) -> list[Work]:
    """Work of each step of a frame of the method ``fast``; every lens counts as foreground.

    ``spp``: samples per rendered pixel. LfsrError for a scale that does not divide the display's views.
    """
    finished = math.prod(display.eia_pixels)
    rendered = math.prod(display.low_views(scale)) * math.prod(display.lenses)
    steps = [Work(TRACE, rendered * spp, bytes=rendered * LAYER_CHANNELS * FLOAT), denoiser_work(rendered)]
    if scale > 1:  # linear, down and then across, from half floats to 8-bit pixels
        across, down = display.parallax
        multiplied = 3 * TAPS * (down * rendered * scale + across * finished)
        steps.append(Work(INTERPOLATE, operations=2 * multiplied,
                          bytes=rendered * 3 * HALF + finished * BYTES_PER_PIXEL))
    shown = display.panel_pixels[0] * display.panel_pixels[1]
    if display.is_woven:
        steps.append(Work(WEAVE, bytes=shown * 3 * (INDEX + 1) + shown * BYTES_PER_PIXEL))
    # The window's system copies the image once, the display reads it once.
    return [*steps, Work(SHOW, bytes=shown * BYTES_PER_PIXEL * 3)]


def denoiser_work(pixels: int) -> Work:
    """Work of the network that ships, in half precision: every layer reads its inputs and writes its outputs."""
    widths, inputs = shipped_network()
    shapes = network_shapes(widths, inputs)
    total = Work(DENOISE, bytes=pixels * (inputs + 3) * FLOAT)
    for layer in LAYERS:
        outputs, entering, rows, columns = shapes[f"{layer}.weight"]
        places = pixels / 4 ** DEPTHS[layer]
        weights = outputs * entering * rows * columns
        # What is upsampled is read at half the size.
        read = entering if layer not in SKIPS else _upsampled(shapes, layer) / 4 + entering - _upsampled(shapes, layer)
        total += Work(DENOISE, 0, round(2 * weights * places), round(HALF * ((read + outputs) * places + weights)))
    return total


@functools.cache
def shipped_network() -> tuple[Sequence[int], int]:
    tensors = read_tza(WEIGHTS)
    return [tensors[f"{layer}.weight"].shape[0] for layer in LAYERS], tensors[f"{LAYERS[0]}.weight"].shape[1]


def _upsampled(shapes: Mapping[str, tuple[int, ...]], layer: str) -> int:
    skip = SKIPS[layer]
    kept = shipped_network()[1] if skip == INPUT else shapes[f"{skip}.weight"][0]
    return shapes[f"{layer}.weight"][1] - kept


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
