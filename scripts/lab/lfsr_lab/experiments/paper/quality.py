"""How near a method's image comes to the reference, and one number per lens for paired comparisons."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.frames.frame import Frame, read_frame
from lfsr_core.frames.reference import Reference
from lfsr_core.metrics.eia_metrics import METRIC_NAMES
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.reconstruct.registry import Method
from lfsr_core.reconstruct.second_stage import linear_and_mask, panel_image
from lfsr_lab.experiments.engine import timing
from lfsr_lab.experiments.engine.accuracy import Target
from lfsr_lab.experiments.engine.cells import to_stderr
from lfsr_lab.experiments.engine.records import Records
from lfsr_lab.experiments.paper import renders, weights
from lfsr_lab.experiments.paper.records import NetworkTimes, Row, SplitError
from lfsr_lab.experiments.paper.renders import View
from lfsr_lab.experiments.paper.settings import CELLS, VERSION, Settings

Record = TypeVar("Record")


@dataclasses.dataclass(frozen=True)
class Finished:
    """What a method made of a render, beside its reference."""

    image: Array  # EIA (H, W, 3), scene-linear, in view order
    frame: Frame  # of the render
    target: Target


def measure_once(records: Records[Record], name: str, inputs: Mapping[str, Any],
                 measure: Callable[[], Record]) -> Record:
    """Return the record ``name``, measured and stored now unless it is there with the same inputs."""
    def measure_now() -> Record:
        to_stderr(f"{records.folder.name:7} {name}")
        return measure()

    return records.get(name, {"version": VERSION, **inputs}, measure_now)


def records_of(settings: Settings, figure: str, kind: type[Record]) -> Records[Record]:
    """Return the records of one figure."""
    return Records(settings.output / CELLS / figure, kind)


def finished(settings: Settings, view: View, method: Method) -> Finished:
    """Return what a method makes of a render."""
    folder = renders.low_resolution(settings, view)
    image, mask = linear_and_mask(folder, method)
    reference = Reference.read(renders.reference(settings, view.scene))
    return Finished(image, read_frame(folder), Target(reference, reference.foreground_mask(mask)))


def row(settings: Settings, records: Records[Row], view: View, name: str, key: str,
        measure: Callable[[Finished, Path], Row]) -> Row:
    """Return the stored row of what a method makes of a render; without figures where its network has no weights.

    Parameters
    ----------
    settings, records : of the study, and where the row is stored
    view : the render
    name : of the method
    key : file name of the record
    measure : makes the row of a finished image; it may write an image of it to the path that it is given
    """
    method, found = weights.method(settings, name), Row()
    if method is not None:
        found = measure_once(records, key, inputs(settings, view, name), lambda: measure(
            finished(settings, view, method), records.folder / f"{key}.png"))
    return dataclasses.replace(found, scene=view.scene.stem, method=name, samples=view.spp)


def accuracy(seen: Finished, _file: Path | None = None) -> Row:
    """Return the metrics of an image, where its error lies, and its split SSIM per foreground lens."""
    seen.target.check(seen.frame)
    found = seen.target.accuracy(seen.image, intervals=False)
    lenses = seen.target.lens_ssim(seen.image)
    return Row(metrics={name: value for name, value in found.metrics.items() if name != "recall"}, ci95=found.ci95,
               error=_errors(seen), lens_ssim_fg=tuple(round(float(value), 6) for value in lenses))


def second_stage_seconds(settings: Settings, folder: Path, method: Method) -> float:
    """Return the median seconds of the whole second stage short of writing files."""
    seconds = timing.take_turns({"": lambda: panel_image(folder, method)}, settings.repeats)
    return timing.median_ms(seconds[""]) / 1e3


def network_times(settings: Settings, networks: Mapping[str, Any], steps: Mapping[str, int]) -> NetworkTimes:
    """Return the seconds of torch modules on random pixels, scene-linear floats in and out as in the second stage.

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

    def run(name: str) -> Callable[[], None]:
        def once() -> None:
            engines[name].run(low)
            if on_gpu:
                torch.cuda.synchronize()
        return once

    seconds = timing.take_turns({name: run(name) for name in engines}, settings.repeats)
    return NetworkTimes(seconds=seconds, engine="cuda" if on_gpu else "torch", threads=torch.get_num_threads(),
                        device=torch.cuda.get_device_name() if on_gpu else "CPU")


def middle_lenses(reference: Reference, count: int) -> Array:
    """Return indices into ``reference.lenses`` of the ``count`` foreground lenses nearest their centre."""
    inside = np.flatnonzero(reference.foreground)
    inside = inside if len(inside) else np.arange(len(reference.lenses))
    centre = reference.lenses[inside].mean(0)
    near = np.argsort(((reference.lenses[inside] - centre) ** 2).sum(1), kind="stable")[:count]
    return inside[np.sort(near)]


def _errors(seen: Finished) -> SplitError | None:
    """Return the squared error of foreground lenses in the outermost ``scale`` views and in the rest."""
    counted = seen.target.reference.foreground
    if not counted.any():
        return None
    ours, half_a, half_b = seen.target.listed(seen.image, counted)
    squares = ((ours - half_a) * (ours - half_b)).mean((0, 3), dtype=np.float64)
    margin, inside = seen.frame.scale, np.zeros(squares.shape, bool)
    inside[margin:-margin, margin:-margin] = True
    border, centre = (float(squares[part].sum() / squares.size) for part in (~inside, inside))
    return SplitError(border, centre, border_pixels=float((~inside).mean()))


def inputs(settings: Settings, view: View, name: str, **more: Any) -> dict[str, Any]:
    """Return what a stored measurement of accuracy depends on."""
    reference = read_frame(renders.reference(settings, view.scene))
    return {"metrics": list(METRIC_NAMES),
            "scene": view.scene.stem, "method": name, "display": settings.display.to_dict(), "scale": settings.scale,
            "convention": settings.convention, "reference_spp": reference.samples,
            "weights": weights.fingerprints(settings, name),
            "lenses": None if reference.lens_list is None else len(reference.lens_list), "spp": view.spp, **more}


def schedules(settings: Settings, names: Iterable[str]) -> dict[str, str]:
    """Return how the network of each method was trained; methods without one are left out."""
    return {name: weights.schedule(weights.weights(settings, part)) for name in names
            for part in MethodName.parse(name).networks}
