"""Temporal averaging of animations: half an hour on two cores; with --cost only what averaging costs on a display.

docs/results/animations.md shows OUT/shots.json, shots.md and shots.svg.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.frames.frame import Request, Sampling
from lfsr_core.images.color import srgb_encode
from lfsr_core.metrics.eia_metrics import mean_of
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.reconstruct import averaging
from lfsr_core.reconstruct.averaging import average_frames, near, read_low
from lfsr_core.reconstruct.methods import DEFAULT_METHOD
from lfsr_core.reconstruct.second_stage import finished_lenses
from lfsr_core.reconstruct.upscaler import LowResEIA
from lfsr_lab.experiments.engine import plots
from lfsr_lab.experiments.engine.plots import svg
from lfsr_lab.experiments.engine.records import (
    REFERENCE,
    SCENE_FILE,
    Cell,
    Records,
    Store,
    StudySettings,
    measured,
    method_facts,
    reference_of,
)
from lfsr_lab.experiments.engine.report import Environment, environment, markdown_table, write_report
from lfsr_lab.experiments.engine.timing import cpu_seconds
from lfsr_lab.experiments.engine.truth import Truth, lens_ssims, linear_images, split_rms


@dataclasses.dataclass(frozen=True)
class Motion:
    """Of one animation."""

    ssim: float  # mean split SSIM of elemental images
    flicker: float  # root mean square of how much more than the reference a pixel changes from frame to frame, percent
    offset: float  # the same of the errors of elemental images' means, percent
    lag: float  # frames by which elemental images' means are late; a wrong brightness counts too where light changes
    cpu_seconds: float  # of the second stage, per frame, of a few lenses finished and all denoised
    change: float  # of a pixel from frame to frame, times that of the reference (root mean squares)


def compare(x: Array, a: Array, b: Array) -> Motion:
    """Return the figures of display values ``x`` (frames, n, py, px, 3) against the halves of the references."""
    ssim = np.stack([lens_ssims(*images) for images in zip(x, a, b, strict=True)])
    steps = [np.diff(values, axis=0) for values in (x, a, b)]
    means = [values.mean((2, 3)) for values in (x, a, b)]
    x, a, b = means
    back_a, back_b = (values[:-1] - values[1:] for values in (a, b))
    late = np.mean((x - a)[1:] * back_b + (x - b)[1:] * back_a, dtype=np.float64) / 2
    change = np.mean(back_a * back_b, dtype=np.float64)
    lag = float(late / change) if change > 0 else 0.0  # of the way back to the frame before
    of_pixels = float(np.sqrt(np.mean(np.square(steps[0])) / np.mean(steps[1] * steps[2], dtype=np.float64)))
    return Motion(mean_of(ssim), 100 * split_rms(*steps), 100 * split_rms(*means), lag, 0.0, of_pixels)


DISPLAY_FILE = Path(__file__).parent / "animations.toml"
NAMES = ("object", "turn", "light", "dance", "array")  # what moves, of lfsr_lab.scenes.animation_scenes
FIXED, CHANGING, TURNING = "fixed", "changing", "turning"  # seeds of the frames; the last begin again after PERIOD
PERIOD = 5
SCENE_SCALE = 4  # at which what the scenes show is within the usable depth
SEED_STEP = 1000  # from the seeds of one repetition to those of the next


@dataclasses.dataclass(frozen=True)
class Settings(StudySettings):
    """What decides every figure of a folder."""

    display: DisplayProfile = dataclasses.field(default_factory=lambda: load_display(DISPLAY_FILE))
    scale: int = 2  # of the low-resolution renders
    frames: int = 6  # of every animation
    samples: tuple[int, ...] = (4, 16)  # per pixel, that are compared
    more: tuple[int, ...] = (8,)  # per pixel, without averaging: what the same time buys, and more
    reference_samples: int = 256  # per pixel, of both halves together
    reference_lenses: int = 48  # drawn at random, the same for every frame
    seed: int = 0  # of everything

    @property
    def lens_list(self) -> tuple[tuple[int, int], ...]:
        """(row, column) of the lenses that references show."""
        sx, sy = self.display.lenses
        chosen = np.random.default_rng(self.seed).choice(sx * sy, self.reference_lenses, replace=False)
        return tuple((int(place) // sx, int(place) % sx) for place in np.sort(chosen))


@dataclasses.dataclass(frozen=True)
class Way:
    """One way to render and finish an animation."""

    name: str
    seeds: str
    reach: int = 0  # half the number of frames that each is averaged with


FIXED_ALONE = Way("fixed seeds, every frame alone", FIXED)
ALONE = Way("seeds that change, every frame alone", CHANGING)
AVERAGED = Way("averaged over 5 frames, 5 seeds in turn", TURNING, PERIOD // 2)
WAYS = (FIXED_ALONE, ALONE, AVERAGED)


@dataclasses.dataclass(frozen=True)
class Animation:
    store: Store
    settings: Settings
    name: str  # of NAMES

    @property
    def folder(self) -> Path:
        return self.store.folder / self.name

    def cells(self) -> Iterator[tuple[Way, int, Cell[Motion]]]:
        """Yield what is measured: ways and samples per pixel."""
        settings = self.settings
        inputs = {"method": DEFAULT_METHOD, **method_facts(DEFAULT_METHOD), "averaging": averaging.VERSION}
        for way, spp in [*itertools.product(WAYS, settings.samples), *((ALONE, spp) for spp in settings.more)]:
            name = f"{way.name} spp{spp}".replace(",", "").replace(" ", "-")
            jobs = self.low(way.seeds, spp)
            yield way, spp, Cell(name, inputs, functools.partial(self._measure, way, jobs), jobs + self.references())

    def low(self, seeds: str, spp: int) -> list[Request]:
        """Return the low-resolution renders of all frames with one kind of seeds."""
        folder = self.folder / f"{seeds}-spp{spp}"
        seed = {FIXED: lambda number: 0, CHANGING: lambda number: number,
                TURNING: lambda number: 1 + (number - 1) % PERIOD}[seeds]
        settings, scene = self.settings, str((self.folder / SCENE_FILE).resolve())
        return [Request(str(FrameFolder.of_frame(folder, number).path), settings.display, scene,
                        sampling=Sampling(settings.scale, spp), frame=number,
                        seed=settings.seed * SEED_STEP + seed(number)) for number in range(1, settings.frames + 1)]

    def references(self) -> list[Request]:
        settings, folder = self.settings, self.folder / REFERENCE
        return [reference_of(job, settings.reference_samples, FrameFolder.of_frame(folder, number).path,
                             lens_list=settings.lens_list) for number, job in enumerate(self.low(CHANGING, 1), start=1)]

    @functools.cached_property
    def truths(self) -> list[Truth]:
        return [Truth(Path(job.output)) for job in self.references()]

    def _measure(self, way: Way, jobs: Sequence[Request]) -> Motion:
        """Finish every frame, averaged with the nearest ones, and compare all with the references."""
        lows, lenses = [read_low(Path(job.output)) for job in jobs], self.truths[0].reference.lenses
        started, everywhere, images = cpu_seconds(), np.ones(len(lenses), bool), []
        for number, low in enumerate(lows):
            others = [lows[other] for other in near(number, range(len(lows)), way.reach)]
            images.append(finished_lenses(average_frames(low, others)[0], everywhere, DEFAULT_METHOD, lenses))
        seconds = (cpu_seconds() - started) / len(lows)
        halves = zip(*(map(srgb_encode, linear_images(truth.reference)) for truth in self.truths), strict=True)
        return dataclasses.replace(compare(srgb_encode(np.stack(images)), *map(np.stack, halves)),
                                   cpu_seconds=round(seconds, 3))


COST_SCALE = 4
NEEDS_OUTPUT = False  # with --cost


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--cost", metavar="NAME", help="display on which to measure only what averaging costs")
    parser.add_argument("--only", nargs="+", choices=NAMES, default=NAMES, help="default: all")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of renders, default: %(default)s")


def run(arguments: argparse.Namespace) -> None:
    """Render and measure what is missing, then write the report."""
    if arguments.cost:
        display, random = load_display(arguments.cost), np.random.default_rng(0)
        (sx, sy), (w, h) = display.lenses, display.low_views(COST_SCALE)
        size = (sy, sx, h, w)
        low, other = (LowResEIA(random.random((*size, 3), np.float32), random.random((*size, 1), np.float32), 16,
                                COST_SCALE) for _ in range(2))
        started = cpu_seconds()  # files do not count
        average_frames(low, [other])
        print(f"{arguments.cost}, scale {COST_SCALE}: {cpu_seconds() - started:.2f} CPU seconds per neighbouring frame")
        return
    settings = Settings(seed=arguments.seed)
    store = Store(arguments.output or Path("animations"), arguments.blender)
    store.claim(settings)
    store.build("animation_scenes.py", {store.folder / name / SCENE_FILE: {"name": name} for name in NAMES},
                display=settings.display.to_dict(), scale=SCENE_SCALE, frames=settings.frames)
    rows = []
    for name in arguments.only:
        animation = Animation(store, settings, name)
        records = Records(animation.folder / "cells", Motion)
        for way, spp, cell in animation.cells():
            for figures in measured([cell], records, store):
                print(f"{name}, {way.name}, {spp} samples: split SSIM {figures.ssim:.4f}, flicker "
                      f"{figures.flicker:.2f}, low-frequency error {figures.offset:.2f}, lag {figures.lag:.2f}",
                      flush=True)
                rows.append(Row(name, way.name, spp, figures))
    write_report(store.folder, STEM, Report(settings, environment(), arguments.command, tuple(rows)),
                 {".md": lambda: markdown(rows), ".svg": lambda: svg(chart(rows))})
    print(markdown(rows))


STEM = "shots"  # of the files
TITLES = {"object": "an object moves", "turn": "an object turns", "light": "the light moves",
          "dance": "a figure dances", "array": "the camera array moves"}
HEADER = ("", "samples", "split SSIM", "flicker", "low-frequency error", "lag, frames", "change")
SHOWN = {"ssim": "split SSIM", "flicker": "flicker, %"}
DRAWN = {FIXED_ALONE.name: "fixed seeds", ALONE.name: "changing seeds", AVERAGED.name: "averaged, 5 frames"}


@dataclasses.dataclass(frozen=True)
class Row:
    """The figures of one way of one animation."""

    animation: str = dataclasses.field(metadata={"key": "shot"})
    way: str
    samples: int
    figures: Motion


@dataclasses.dataclass(frozen=True)
class Report:
    settings: Settings
    environment: Environment
    command: str
    rows: tuple[Row, ...]


def markdown(rows: Sequence[Row]) -> str:
    lines: list[str] = []
    for name in dict.fromkeys(row.animation for row in rows):
        cells = [(row.way, row.samples, f"{row.figures.ssim:.4f}", f"{row.figures.flicker:.2f}",
                  f"{row.figures.offset:.2f}", f"{row.figures.lag:.2f}", f"{row.figures.change:.2f}")
                 for row in rows if row.animation == name]
        lines += [f"**{TITLES[name]}**", "", *markdown_table(HEADER, cells, "lr"), ""]
    return "\n".join(lines)


def chart(rows: Sequence[Row]) -> Any:
    """Draw a column per animation: split SSIM above, flicker below, over the samples."""
    names = [name for name in NAMES if any(row.animation == name for row in rows)]
    figure, grid = plots.panel_sheet(len(SHOWN) * len(names), columns=len(names))
    for axes, (kind, name) in zip(grid, [(kind, name) for kind in SHOWN for name in names], strict=True):
        curves = []
        for number, way in enumerate(DRAWN):
            points = sorted((row.samples, getattr(row.figures, kind)) for row in rows
                            if row.animation == name and row.way == way)
            x, y = zip(*points, strict=True)
            curves.append(plots.Curve(DRAWN[way], plots.COLORS[number], plots.MARKERS[number], x, y,
                                      bold=way == AVERAGED.name))
        axes.set_xscale("log", base=2)
        ticks = sorted({x for curve in curves for x in curve.x})
        axes.set_xticks(ticks, [f"{tick:g} samples" if tick == ticks[0] else f"{tick:g}" for tick in ticks])
        axes.set_xticks([], minor=True)
        axes.margins(0.08)
        plots.draw_curves(axes, curves, f"{TITLES[name]}: {SHOWN[kind]}")
    return figure
