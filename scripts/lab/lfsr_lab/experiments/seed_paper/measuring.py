"""Cells of accuracy and time that several figures have in common."""

from __future__ import annotations

import dataclasses
import functools
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.frame import Frame, read_frame
from lfsr_core.metrics.eia_metrics import METRIC_NAMES
from lfsr_core.reconstruct.second_stage import finished_panel, linear_and_mask
from lfsr_lab.experiments.engine import timing
from lfsr_lab.experiments.engine.records import Cell
from lfsr_lab.experiments.engine.timing import Seconds
from lfsr_lab.experiments.engine.truth import Metrics, Truth
from lfsr_lab.experiments.seed_paper import renders, weights
from lfsr_lab.experiments.seed_paper.figure import LENS_SSIM, SECONDS, Row, Rows
from lfsr_lab.experiments.seed_paper.renders import CELLS, SCALE, Settings, View

TIME_COLUMNS = ("ms", "quartile 1", "quartile 3")
FRAME_COLUMNS = RENDER, SECOND_STAGE, TOTAL = ("render, s", "second stage, s", "sum, s")


@dataclasses.dataclass(frozen=True)
class Finished:
    """What a method makes of a render, beside its reference."""

    image: Array  # EIA (H, W, 3), scene-linear, in view order
    folder: Path  # of the render
    frame: Frame  # in it
    method: weights.Ready
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

    def run() -> Rows:
        method, found = weights.method(settings, name), Row(has_weights=False)
        if method is not None:
            folder, truth = renders.rendered(settings, view), Truth(renders.reference(settings, view.scene))
            frame = read_frame(folder)
            truth.check(frame)
            image, _ = linear_and_mask(folder, method[0], upscaler=method[1])
            file = settings.output / CELLS / figure / f"{key}.png"
            found = measure(Finished(image, folder, frame, method, truth, file))
        return Rows((dataclasses.replace(found, scene=scene, method=label, samples=view.spp),))

    return Cell(key, {**_inputs(settings, view, name), **inputs}, run)


def _inputs(settings: Settings, view: View, name: str) -> dict[str, Any]:
    """Return what the accuracy of a method on a render depends on."""
    folder = renders.reference(settings, view.scene)
    reference = read_frame(folder)
    if reference.lens_list is not None:
        raise LfsrError(f"{folder} shows only some lenses: give --bench a folder whose references show every lens")
    return {"metrics": list(METRIC_NAMES), "scene": view.scene.stem, "method": name, "scale": view.scale,
            "spp": view.spp, "layout": view.layout, "display": settings.display.to_dict(),
            "reference_spp": reference.samples, "weights": weights.fingerprints(settings, name)}


def accuracy(made: Finished) -> Row:
    """Return the metrics of an image, and its split SSIM per foreground lens."""
    lenses = tuple(round(float(value), 6) for value in made.truth.lens_ssim(made.image))
    return Row(values=made.truth.metrics(made.image), series={LENS_SSIM: lenses})


def frame_seconds(settings: Settings, folder: Path, method: weights.Ready) -> Metrics:
    """Return the seconds of a frame: its render, and the median of the second stage short of writing files."""
    seconds = timing.take_turns({"": lambda: finished_panel(folder, method[0], upscaler=method[1])}, settings.repeats)
    render, second_stage = read_frame(folder).seconds["render"], timing.median_ms(seconds[""]) / 1e3
    return {RENDER: render, SECOND_STAGE: second_stage, TOTAL: render + second_stage}


def timed_rows(seconds: Seconds, scene: str = "", how: str = "",
               facts: Mapping[str, float | None] | None = None) -> Rows:
    """Return a row per function that was run in turns: quartiles, ``facts``, and every run."""
    quartiles = {name: 1e3 * np.percentile(times, (50, 25, 75)) for name, times in seconds.items()}
    return Rows(tuple(Row(scene=scene, method=name, how=how, series={SECONDS: seconds[name]},
                          values={**(facts or {}), **dict(zip(TIME_COLUMNS, map(float, found), strict=True))})
                      for name, found in quartiles.items()))


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
        engines = {name: Engine(weights.untrained(network, SCALE), device=settings.device, step=step)
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
