"""What several figures have in common: settings, renders, weights, and cells of accuracy and time.

``BENCH/SCENE/reference``, ``BENCH/SCENE/s{scale}-spp{n}`` and variants of the latter; what is there is used as it is.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import read_json, write_json
from lfsr_core.commands.common import ProgressBar
from lfsr_core.frames.frame import Frame, Request, Sampling, check_scene, read_frame
from lfsr_core.metrics.eia_metrics import METRIC_NAMES
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.process.child import find_blender
from lfsr_core.reconstruct.second_stage import finished_linear, finished_panel
from lfsr_lab.experiments.engine import timing
from lfsr_lab.experiments.engine.records import REFERENCE, Cell, Store, StudySettings, reference_of, to_stderr
from lfsr_lab.experiments.engine.report import number
from lfsr_lab.experiments.engine.timing import Seconds
from lfsr_lab.experiments.engine.truth import Metrics, Truth
from lfsr_lab.networks import comparators
from lfsr_lab.networks.methods import LabMethod, Ready
from lfsr_lab.scenes import run_script, scene_script
from lfsr_lab.train.config import load_config

if TYPE_CHECKING:
    from torch import nn

CELLS = "cells"  # folder of measurements
VERSION = 5  # increase it when a measurement of the same inputs yields other numbers
SCALE = 4  # factor of the low-resolution renders
QUICK_DISPLAY = DisplayProfile("paper-quick", (192, 112), (192.0, 112.0), (12, 7), (16, 16), 250.0, 40.0)


@dataclasses.dataclass(frozen=True)
class Settings(StudySettings):
    output: Path  # folder of everything that is made
    scenes: tuple[Path, ...]  # scene files
    bench: Path  # folder of renders on ``display``, may be shared
    display: DisplayProfile  # for accuracy
    timing_display: DisplayProfile  # for times of whole frames
    spp: int = 16  # samples per pixel that a user renders with
    clean_spp: int = 4096  # samples per pixel nearly free of noise
    reference_spp: int = 1024  # samples per pixel of a reference
    weights: Path | None = None  # folder of trained networks, None for those that ship
    train_epochs: int = 0  # training per missing network, 0 trains none
    photographs: str = ""  # to train with, empty for those of the built-in configs
    device: str = "auto"  # for networks
    render_device: str = "CPU"  # for Cycles
    blender: str | None = None  # executable, None to look for one
    repeats: int = 10  # runs of everything timed but renders
    steps: tuple[int, ...] = (8, 16, 32, 48, 80, 128, 208)  # elemental images per call in Fig. 10(a)
    moves: tuple[float, ...] = (0.3, 0.45, 0.7, 1.0, 1.6)  # distances of the camera array in Fig. 10(b), 1: its own
    resolutions: tuple[int, ...] = (4, 2, 1)  # divisors of ``timing_display`` in Fig. 12(a)
    workload: tuple[int, int] = (5184, 20)  # elemental images and their side where only a network is timed
    quick: bool = False  # whether the run only touches every figure

    def facts(self) -> dict[str, Any]:
        """Return what the page says about the run: no paths."""
        names = ("spp", "clean_spp", "reference_spp", "train_epochs", "repeats", "quick", "render_device")
        return {**{name: getattr(self, name) for name in names}, "display": self.display.name,
                "timing_display": self.timing_display.name, "version": VERSION,
                "scenes": [scene.stem for scene in self.scenes]}


def make_settings(output: Path, quick: bool = False, **changes: Any) -> Settings:
    """Return the settings of a run; ``quick`` touches every figure in minutes, and its numbers mean little."""
    values: dict[str, Any] = {"display": "small", "timing_display": "bupt-32in-8k"}
    if quick:
        values = {"display": QUICK_DISPLAY, "timing_display": QUICK_DISPLAY, "spp": 4, "clean_spp": 64, "repeats": 6,
                  "reference_spp": 32, "steps": (8, 48, 208), "moves": (0.5, 1.0, 2.0), "resolutions": (2, 1),
                  "workload": (416, 20), "quick": True}
    values |= {"output": output, "bench": output / "bench", **changes}
    displays = {name: load_display(value) for name, value in values.items()
                if name in ("display", "timing_display") and isinstance(value, str)}
    return Settings(**values | displays)


@dataclasses.dataclass(frozen=True)
class View:
    scene: Path  # its file
    spp: int  # samples per pixel
    scale: int = SCALE  # factor, 1 for every view
    display: DisplayProfile | None = None  # None for that of accuracy
    layout: str = "one-pass"  # how views are rendered, see ``Job``


def rendered(settings: Settings, view: View) -> Path:
    """Return the frame folder of a render; LfsrError where the folder holds another one."""
    return store(settings).rendered(_job(settings, view))


def reference(settings: Settings, scene: Path) -> Path:
    """Return the reference folder of a scene on ``settings.display``; one that is there may have any samples."""
    job = _job(settings, View(scene, settings.spp))
    return store(settings).rendered(reference_of(job, settings.reference_spp, Path(job.output).with_name(REFERENCE)))


def store(settings: Settings) -> Store:
    return Store(settings.output, settings.blender)


def _job(settings: Settings, view: View) -> Request:
    """Return the job of a render, on ``settings.display`` in the shared folder of renders."""
    display = view.display or settings.display
    bench = settings.bench if display == settings.display else settings.output / f"bench-{display.name}"
    variant = "" if view.layout == "one-pass" else f"-{view.layout}"
    folder = bench / view.scene.stem / f"s{view.scale}-spp{view.spp}{variant}"
    return Request(output=str(folder), display=display, scene=check_scene(view.scene),
                   sampling=Sampling(view.scale, view.spp), layout=view.layout, device=settings.render_device)


def moved(settings: Settings, scene: Path, fraction: float) -> Path:
    """Return a copy of ``scene`` whose camera array stands at a fraction of its distance from the display plane."""
    path = settings.output / "moved" / f"{scene.stem}-{settings.timing_display.name}-{fraction:g}.blend"
    if not path.exists():
        job = path.with_suffix(".json")
        write_json(job, {"scene": check_scene(scene), "display": settings.timing_display.to_dict(), "share": fraction,
                         "output": str(path.resolve())})
        run_script(find_blender(settings.blender), scene_script("move_camera_array.py"), job, [path])
    return path


def demo_scene(output: Path, blender: str | None) -> Path:
    """Return the demo scene, built by the script that ships with the repository."""
    path = output / "demo.blend"
    if not path.exists():
        output.mkdir(parents=True, exist_ok=True)
        run_script(find_blender(blender), scene_script("demo_scene.py"), path, [path])
    return path


def resolution(display: DisplayProfile, divisor: int) -> DisplayProfile | None:
    """Return a display of the same lenses with views and pixels divided, None where they do not divide."""
    if any(count % divisor for count in display.views):
        return None
    (px, py), (width, height) = display.views, display.panel_pixels
    return dataclasses.replace(display, name=f"{display.name}-1-{divisor}" if divisor > 1 else display.name,
                               views=(px // divisor, py // divisor), panel_pixels=(width // divisor, height // divisor))


SHORT_CONFIG, ADVERSARIAL = "paper-short", 1e-3
NONE = "no weights"


def weights(settings: Settings, name: str) -> Path | None:
    """Return the weights of a network, None if there are none.

    Those given, else those trained in this output folder (now, if epochs were granted), else those that ship.
    """
    for folder in filter(None, (settings.weights, trained_folder(settings, name))):
        path = comparators.weights_path(name, SCALE, folder)
        if path.with_suffix(".json").exists():  # written last
            return path
    if settings.train_epochs > 0:
        return train(settings, comparators.spec(name).stem)
    return comparators.spec(name).weights.get(SCALE)


def trained_folder(settings: Settings, name: str) -> Path:
    """Return the folder where a network is trained; another number of epochs is another schedule."""
    return settings.output / f"weights-{settings.train_epochs}epochs" / comparators.spec(name).stem


def schedule(path: Path | None) -> str:
    """Return how weights were trained, in one phrase whose last part is time and device."""
    if path is None:
        return NONE
    facts = _provenance(path)
    config, took = facts.get("config", {}), f"{facts.get('seconds', 0.0):.0f} s on {facts.get('device')}"
    if not {"epochs", "crop", "rate", "schedule"} <= config.keys():
        return "schedule not recorded"
    start = ", begun from the trained generator" if config.get("start") else ""
    return (f"{config['epochs']} epochs of {config['crops_per_photograph']} {config['crop']}-pixel crops per "
            f"photograph, rate {config['rate']:g} {config['schedule']}{start}, {took}")


def _provenance(path: Path) -> dict[str, Any]:
    return read_json(path.with_suffix(".json"), "the provenance beside the weights")


def fingerprints(settings: Settings, name: str) -> dict[str, str | None]:
    """Return the hash of the weights of a method's network, None where there are none; empty without a network."""
    network = LabMethod.parse(name).network
    path = weights(settings, network) if network else None
    return {network: _provenance(path).get("sha256") if path else None} if network else {}


def schedules(settings: Settings, names: Iterable[str]) -> dict[str, str]:
    """Return how the network of each method was trained; methods without one are left out."""
    networks = {name: network for name in names if (network := LabMethod.parse(name).network)}
    return {name: schedule(weights(settings, network)) for name, network in networks.items()}


def method(settings: Settings, name: str) -> Ready | None:
    """Return a method, its network with the weights chosen here; None where these are missing."""
    parsed = LabMethod.parse(name)
    path = weights(settings, parsed.network) if parsed.network else None
    return None if parsed.network and path is None else parsed.ready(path, settings.device)


def untrained(name: str, scale: int) -> nn.Module:
    """Return a network with random weights of seed 0: its speed does not depend on them."""
    import torch

    from lfsr_lab.networks.networks import build

    torch.manual_seed(0)
    return build(name, scale).eval().requires_grad_(False)


def untrained_method(settings: Settings, name: str, scale: int) -> Ready:
    """Return the method for timing at any scale, its network with random weights."""
    if not LabMethod.parse(name).network:
        return LabMethod.parse(name).ready()
    from lfsr_lab.networks import checkpoint as files

    path = comparators.weights_path(name, scale, settings.output / "untrained")
    if not path.exists():
        files.save(path, untrained(name, scale), scale, {"untrained": True}, comparators.spec(name).options)
    return LabMethod.parse(name).ready(path, settings.device)


def train(settings: Settings, name: str) -> Path:
    """Train a network by the short recipe for the epochs of the settings; a run that was stopped continues.

    LfsrError where photographs are missing; KeyboardInterrupt if it is stopped.
    """
    from lfsr_lab.train import loop, session

    folder = trained_folder(settings, name)
    changes: dict[str, Any] = {"network": name, "scale": SCALE, "epochs": settings.train_epochs,
                               "validate_every": settings.train_epochs + 1}
    if settings.photographs:
        changes |= {"photographs": settings.photographs, "validation": settings.photographs}
    if name.endswith("-gan"):  # begins with the trained generator
        changes |= {"adversarial": ADVERSARIAL, "start": weights(settings, name.removesuffix("-gan"))}
    config = load_config(SHORT_CONFIG, [f"{key}={value}" for key, value in changes.items()])
    to_stderr(f"training {name} x{SCALE}: {config.epochs} epochs")
    with contextlib.closing(ProgressBar()) as bar:
        options = loop.RunOptions(resume=(folder / loop.CHECKPOINT).exists(), tell=bar)
        trained = session.train(config, folder, settings.device, options)
    if trained.weights is None:
        raise KeyboardInterrupt
    return trained.weights


LENS_SSIM, SECONDS = "split SSIM of lenses", "seconds"  # names of series
ACCURACY = "ssim_eia_fg"  # the metric that is drawn: split SSIM of the foreground
LARGE = 100  # numbers from here on have no decimals


@dataclasses.dataclass(frozen=True, kw_only=True)
class Row:
    scene: str = ""  # its name, or that of the case
    method: str = ""  # its name, or that of the row
    how: str = ""  # how it was made, where the method does not tell
    samples: int | None = None  # per pixel of the render
    values: Metrics = dataclasses.field(default_factory=dict)  # by column; empty where nothing was measured
    # One number per foreground lens, row of lenses or run; those of two methods are compared pair by pair.
    series: dict[str, tuple[float, ...]] = dataclasses.field(default_factory=dict)
    image: str | None = None  # file name, in the folder of the figure's measurements
    has_weights: bool = True  # False: nothing was measured

    def value(self, name: str) -> float:
        """Return a value, 0 where it is not known."""
        return self.values.get(name) or 0.0

    def text(self, name: str) -> str:
        """Return a value as the table shows it."""
        value = self.values.get(name)
        return number(value, digits=3 if value is None or abs(value) < LARGE else 0)


@dataclasses.dataclass(frozen=True)
class Rows:
    """What one cell measures at once."""

    rows: tuple[Row, ...]


@dataclasses.dataclass(frozen=True)
class Results:
    rows: tuple[Row, ...]
    load: float | None = None  # highest load average seen after any measurement, None where the system tells none
    schedules: dict[str, str] = dataclasses.field(default_factory=dict)  # how each method's network was trained


TIME_COLUMNS = ("ms", "quartile 1", "quartile 3")
FRAME_COLUMNS = RENDER, SECOND_STAGE, TOTAL = ("render, s", "second stage, s", "sum, s")


@dataclasses.dataclass(frozen=True)
class Finished:
    """What a method makes of a render, beside its reference."""

    image: Array  # EIA (H, W, 3), scene-linear, in view order
    folder: Path  # of the render
    frame: Frame  # in it
    method: Ready
    truth: Truth
    file: Path  # for an image of it


def accuracy_cell(settings: Settings, figure: str, view: View, name: str, measure: Callable[[Finished], Row],
                  label: str = "", **inputs: Any) -> Cell[Rows]:
    """Return the cell of what a method makes of a render.

    Parameters
    ----------
    settings, figure : of the study, and the figure's id
    view : the render
    name : of the method; without weights of its network the row only says so
    measure : returns the row, and may write an image
    label : name of the row instead of the method's
    inputs : what the row depends on besides method, render and reference
    """
    label, scene = label or name, view.scene.stem
    key = re.sub(r"\W+", "-", f"{scene}-spp{view.spp}-{label}").strip("-")

    truth = Truth(reference(settings, view.scene))
    reference_frame = read_frame(truth.folder)
    if reference_frame.lens_list is not None:
        raise LfsrError(f"{truth.folder} shows only some lenses: give --bench a folder whose references show all")
    facts = {"metrics": list(METRIC_NAMES), "scene": scene, "method": name, "scale": view.scale, "spp": view.spp,
             "layout": view.layout, "display": settings.display.to_dict(), "reference_spp": reference_frame.samples,
             "weights": fingerprints(settings, name)}

    def run() -> Rows:
        ready, row = method(settings, name), Row(has_weights=False)
        if ready is not None:
            folder = rendered(settings, view)
            frame = read_frame(folder)
            truth.check(frame)
            image = finished_linear(folder, ready[0], upscaler=ready[1])
            file = settings.output / CELLS / figure / f"{key}.png"
            row = measure(Finished(image, folder, frame, ready, truth, file))
        return Rows((dataclasses.replace(row, scene=scene, method=label, samples=view.spp),))

    return Cell(key, facts | inputs, run)


def accuracy(made: Finished) -> Row:
    """Return the metrics of an image, and its split SSIM per foreground lens."""
    lenses = tuple(round(float(value), 6) for value in made.truth.lens_ssim(made.image))
    return Row(values=made.truth.metrics(made.image), series={LENS_SSIM: lenses})


def frame_seconds(settings: Settings, folder: Path, method: Ready) -> Metrics:
    """Return the seconds of a frame: its render, and the median of the second stage short of writing files."""
    seconds = timing.take_turns({"": lambda: finished_panel(folder, method[0], upscaler=method[1])}, settings.repeats)
    render, second_stage = read_frame(folder).seconds["render"], timing.median_ms(seconds[""]) / 1e3
    return {RENDER: render, SECOND_STAGE: second_stage, TOTAL: render + second_stage}


def timed_rows(seconds: Seconds, scene: str = "", how: str = "",
               facts: Mapping[str, float | None] | None = None) -> Rows:
    """Return a row per function that was run in turns: quartiles, ``facts``, and every run."""
    quartiles = {name: 1e3 * np.percentile(times, (50, 25, 75)) for name, times in seconds.items()}
    return Rows(tuple(Row(scene=scene, method=name, how=how, series={SECONDS: seconds[name]},
                          values={**(facts or {}), **dict(zip(TIME_COLUMNS, map(float, percentiles), strict=True))})
                      for name, percentiles in quartiles.items()))


def network_times(settings: Settings, steps: Mapping[str, tuple[str, int]]) -> Cell[Rows]:
    """Return the cell that times networks alone, in turns, on random elemental images.

    ``steps``: network and elemental images per call by the row's name; how many of which size is in the settings.
    """
    def run() -> Rows:
        import torch

        from lfsr_lab.networks.upscalers import Engine

        count, side = settings.workload
        on_gpu = torch.cuda.is_available() and settings.device != "cpu"
        low = torch.rand(count, side, side, 3, generator=torch.Generator().manual_seed(0))
        low = low.cuda() if on_gpu else low
        engines = {name: Engine(untrained(network, SCALE), device=settings.device, step=step)
                   for name, (network, step) in steps.items()}

        def once(name: str) -> None:
            engines[name].run(low)
            if on_gpu:
                torch.cuda.synchronize()

        runs = {name: functools.partial(once, name) for name in steps}
        device = torch.cuda.get_device_name() if on_gpu else f"CPU, {torch.get_num_threads()} threads"
        return timed_rows(timing.take_turns(runs, settings.repeats), how=f"{count} of {side}×{side}, {device}")

    inputs = {"steps": {name: list(step) for name, step in steps.items()}, "workload": list(settings.workload),
              "repeats": settings.repeats, "device": settings.device}
    return Cell("times", inputs, run)
