"""Count what a frame at 8K asks of a GPU, and measure it where there is one.

Counts and published rates alone; with --measure this machine's device too.
OUT/gpu-budget.json keeps what was measured; OUT/gpu-budget.md is the page.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import math
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import torch

from lfsr_core.base.arrays import Array
from lfsr_core.base.records import read_record, write_record
from lfsr_core.commands.sentences import sentence
from lfsr_core.frames.frame import AUTO, GUIDES, Request, Sampling, read_frame
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.reconstruct.averaging import read_low
from lfsr_core.reconstruct.methods.denoise import INPUT, LAYERS, SKIPS, WEIGHTS, denoise_low_resolution, network_shapes
from lfsr_lab.experiments.engine import report, timing
from lfsr_lab.experiments.engine.records import Store
from lfsr_lab.networks.tza import read_tza

TRACE, DENOISE, INTERPOLATE, WEAVE, SHOW = "path tracing", "denoising", "interpolation", "weave", "display"
HALF, FLOAT, BYTES_PER_PIXEL = 2, 4, 4  # bytes of a number in the network, of one in the render, of a shown pixel
LAYER_CHANNELS = 4 + 3 + 3  # colour with opacity, albedo, normal
REPEATS = 7
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
    tables = tomllib.loads(GPUS.read_text(encoding="utf-8"))["gpu"]
    return [GPU(**{**fields, "samples_per_second": tuple(fields["samples_per_second"]),
                   "sources": tuple(fields["sources"])}) for fields in tables]


def frame_ms(gpu: GPU, steps: Sequence[Work]) -> tuple[float, float]:
    """Least milliseconds of a whole frame, its steps one after another."""
    times = [gpu.least_ms(work) for work in steps]
    return sum(low for low, _ in times), sum(high for _, high in times)


def fitting_samples(gpu: GPU, display: DisplayProfile, scale: int) -> tuple[float, float]:
    """Samples per rendered pixel that fit into a frame beside the other steps, at the lowest and highest rate."""
    steps = frame_work(display, scale, 1)
    left = FRAME_MS - sum(gpu.least_ms(work)[0] for work in steps if work.step != TRACE)
    pixels = next(work.samples for work in steps if work.step == TRACE)
    low, high = (max(0.0, left / 1e3 * rate / pixels) for rate in gpu.samples_per_second)
    return low, high


@dataclasses.dataclass(frozen=True)
class Measured:
    display: str
    scale: int
    spp: int
    device: str  # of Cycles
    tensors: str  # device of PyTorch, which interpolates and weaves
    samples_per_second: float  # by which a render takes longer, without what it takes before the first sample
    started_ms: float  # of a render before the first sample
    milliseconds: dict[str, float]  # by step, medians
    notes: tuple[str, ...]  # of the denoiser
    environment: report.Environment
    load: float | None  # of the machine


def measure(store: Store, scene: Path, display: DisplayProfile, scale: int, spp: int) -> Measured:
    """Render with ``spp`` and four times as many samples, then time every other step."""
    jobs = [Request(str(store.folder / f"scale-{scale}-spp-{count}"), display, str(scene),
                    sampling=Sampling(scale, count), layers=GUIDES, device=AUTO) for count in (spp, 4 * spp)]
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
                    - milliseconds[TRACE]), milliseconds, notes, report.environment(), report.load_average())


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

    milliseconds = {INTERPOLATE: median_ms(interpolated, device)} if factors != (1, 1) else {}
    shown = torch.zeros((*display.panel_pixels[::-1], 4), dtype=torch.uint8, device=device)
    if display.is_woven:
        finished = interpolated().flatten()
        places = torch.randint(finished.numel(), (shown.numel() * 3 // 4,), device=device)
        milliseconds[WEAVE] = median_ms(lambda: finished.take(places), device)
    target = torch.empty_like(shown)
    return {**milliseconds, SHOW: median_ms(lambda: target.copy_(shown), device)}


def best_device() -> torch.device:
    """The accelerator of PyTorch, the CPU without one."""
    return torch.accelerator.current_accelerator() or torch.device("cpu")


def median_ms(work: Callable[[], object], device: torch.device | None = None) -> float:
    """Median milliseconds of ``REPEATS`` calls after one that does not count, each until the device has finished."""
    def finished() -> None:
        work()
        if device is not None and device.type != "cpu":
            torch.accelerator.synchronize()

    return timing.median_ms(timing.take_turns({"": finished}, REPEATS)[""])


STEM = "gpu-budget"


@dataclasses.dataclass(frozen=True)
class Record:
    measured: tuple[Measured, ...] = ()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--measure", type=Path, metavar="SCENE", help="render this scene and time every step")
    add("--display", default=DISPLAY, metavar="NAME", help="of the measurement; default: %(default)s")
    add("--scale", type=int, default=EXAMPLE[0], metavar="S", help="of the measurement; default: %(default)s")
    add("--spp", type=int, default=EXAMPLE[1], metavar="N", help="of the measurement; default: %(default)s")


def run(arguments: argparse.Namespace) -> None:
    """Measure if asked to, then write the page and name its files."""
    path = arguments.output / f"{STEM}.json"
    record = read_record(path, Record, "measured steps") if path.exists() else Record()
    if arguments.measure:
        measured = measure(Store(arguments.output / "renders", arguments.blender), arguments.measure,
                           load_display(arguments.display), arguments.scale, arguments.spp)
        record = Record((*(earlier for earlier in record.measured if _place(earlier) != _place(measured)), measured))
    write_record(path, record)
    texts = {".md": lambda: markdown(read_gpus(), record.measured)}
    print("\n".join(map(str, report.write_report(arguments.output, STEM, None, texts))))


def _place(measured: Measured) -> tuple[object, ...]:
    return measured.device, measured.environment.machine, measured.display, measured.scale, measured.spp


DISPLAY, WOVEN = "bupt-32in-8k", "looking-glass-65"
SCALES, SAMPLES, EXAMPLE = (1, 2, 4, 5, 8), (1, 4, 16), (4, 4)
COMMAND = "lfsr study gpu-budget"


def markdown(gpus: Sequence[GPU], measured: Sequence[Measured]) -> str:
    display, woven = load_display(DISPLAY), load_display(WOVEN)
    scale, spp = EXAMPLE
    steps = frame_work(display, scale, spp)
    weave = next(work.bytes for work in frame_work(woven, 1, 1) if work.step == WEAVE)
    counted, rated, fitting = [], [], []
    for factor in SCALES:
        by_step = {work.step: work for work in frame_work(display, factor, 1)}
        denoised, grown = by_step[DENOISE], by_step.get(INTERPOLATE)
        counted.append([f"{factor}", *(f"{by_step[TRACE].samples * count / 1e6:.1f}" for count in SAMPLES),
                        f"{denoised.operations / 1e9:.1f}", f"{denoised.bytes / 1e6:.0f}",
                        f"{grown.operations / 1e9:.1f}" if grown else report.UNKNOWN,
                        f"{grown.bytes / 1e6:.0f}" if grown else report.UNKNOWN,
                        f"{by_step[SHOW].bytes / 1e6:.0f}"])
    for gpu in gpus:
        best, worst = frame_ms(gpu, steps)
        slowest = max(steps, key=lambda work: gpu.least_ms(work)[0])
        rated.append([gpu.name, *(_span(gpu.least_ms(work), 1) for work in steps), _span((best, worst), 0),
                      _span((1e3 / worst, 1e3 / best), 0), f"{slowest.step} ({gpu.limit(slowest)})"])
        spans = {factor: fitting_samples(gpu, display, factor) for factor in SCALES}
        fitting.append([gpu.name, *(f"{_span((low, high), 1)} ({_span((low / factor ** 2, high / factor ** 2), 2)})"
                                    for factor, (low, high) in spans.items())])
    rows = [[row.device, row.tensors, f"{row.scale}, {row.spp}", f"{row.samples_per_second / 1e6:.2f}",
             f"{row.started_ms / 1e3:.1f}", *(
                 f"{row.milliseconds[work.step]:.0f}" if work.step in row.milliseconds else report.UNKNOWN
                 for work in steps)] for row in measured]
    lines = [
        "# What 30 frames per second at 8K ask of a GPU", "",
        f"`{COMMAND}` counts and writes this page. Milliseconds are the least that published rates allow, "
        "every step alone on the GPU, nothing copied to main memory. The method is `fast` "
        f"(denoiser and linear interpolation); every lens is foreground. One frame has {FRAME_MS:.1f} ms.", "",
        "## Counts", "",
        f"`{DISPLAY}`, one frame. Samples are paths from the camera, in millions.", "",
        *report.markdown_table(["scale", *(f"samples at {count}" for count in SAMPLES), "denoiser: 10⁹ operations",
                                "MB", "interpolation: 10⁹ operations", "MB", "display: MB"], counted, "r"), "",
        f"The weave of a lenticular 8K panel (`{WOVEN}`) moves {weave / 1e6:.0f} MB more. The denoiser's "
        "bytes are those of layers that are not fused: each reads its inputs and writes its outputs in half "
        "precision.", "",
        "## At published rates", "",
        f"Scale {scale}, {spp} samples per rendered pixel, which is {spp / scale ** 2:g} rays per finished pixel. Two "
        "figures: at the highest and at the lowest published rate of samples.", "",
        *report.markdown_table(["GPU", *(work.step for work in steps), "frame, ms", "frames per second", "what limits"],
                        rated, "lr"), "",
        "What fits beside the other steps, samples per rendered pixel (rays per finished pixel):", "",
        *report.markdown_table(["GPU", *(f"scale {factor}" for factor in SCALES)], fitting, "lr"), "",
        *_conclusion(gpus, display), "",
        "## Sources", "", *(f"- {gpu.name}: {'; '.join(gpu.sources)}." for gpu in gpus), "",
        "The samples are of scenes of production, with other renderers for two of the three; a frame of ours also "
        "pays for the lens card ([devices](../reference/devices.md)). Peak rates of arithmetic and memory are never "
        "reached.", "",
        "## Measured", "",
        f"`{COMMAND} --measure SCENE -o OUT` measures the same steps on the best device that Cycles, Open Image "
        "Denoise and PyTorch find, and adds a row. Denoising includes the copies to the device and back.", "",
        *report.markdown_table(["Cycles on", "PyTorch on", "scale, samples", "10⁶ samples per second",
                         "before the first sample, s", *(work.step for work in steps)], rows, "llr")]
    return "\n".join(lines) + "\n"


def _conclusion(gpus: Sequence[GPU], display: DisplayProfile) -> Iterable[str]:
    steps = frame_work(display, *EXAMPLE)
    others = [sum(gpu.least_ms(work)[0] for work in steps if work.step != TRACE) for gpu in gpus]
    best = max(fitting_samples(gpu, display, EXAMPLE[0])[1] for gpu in gpus)
    scale = max(SCALES)
    largest = max(fitting_samples(gpu, display, scale)[1] for gpu in gpus)
    yield (f"**Rays limit everywhere**: at scale {EXAMPLE[0]} all other steps take {min(others):.1f} to "
           f"{max(others):.1f} ms. In scenes of production at most {best:.1f} samples per rendered pixel fit at that "
           f"scale, and {largest:.1f} at scale {scale}; a table's value below 1 is out of reach. Two "
           "things help. A sample that meets the background costs almost nothing: with a fifth of the elemental images "
           "in the foreground up to five times as many fit. And light scenes trace faster: a bare path tracer with up "
           "to 16 bounces sends 3.3·10⁹ samples per second through one statue on an RTX 4090 "
           "(<https://github.com/GPSnoopy/RayTracingInVulkan/issues/62>), 30 to 50 times the rates above; 16 samples "
           f"at scale {EXAMPLE[0]} then take 10 ms. So the paper's 33 ms fit light scenes at scale 4 and 5, and scenes "
           "of production at scale 8 on the fastest of these.")


def _span(values: tuple[float, float], digits: int) -> str:
    low, high = (f"{value:.{digits}f}" for value in sorted(values))
    return low if low == high else f"{low} to {high}"
