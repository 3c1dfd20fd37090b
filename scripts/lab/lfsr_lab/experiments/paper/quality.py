"""A method's picture against the reference: the usual metrics, and one number per lens for paired comparisons."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.frames.frame import Frame, read_frame
from lfsr_core.frames.reference import Reference, check_reference
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.metrics.eia_metrics import METRIC_NAMES, SAMPLED_NAMES, compare
from lfsr_core.metrics.split_ssim import stacked_ssim
from lfsr_core.optics.eia import to_elemental_images
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.reconstruct.registry import Method
from lfsr_core.reconstruct.second_stage import linear_and_mask, panel_image
from lfsr_lab.experiments.paper import renders, timing, weights
from lfsr_lab.experiments.paper.cells import Cells
from lfsr_lab.experiments.paper.records import Row, SplitError
from lfsr_lab.experiments.paper.renders import Shot
from lfsr_lab.experiments.paper.settings import Settings


@dataclasses.dataclass(frozen=True)
class Picture:
    """What a method made of a render, beside its reference."""

    image: Array  # EIA (H, W, 3), scene-linear, in view order
    mask: Array  # (sy, sx) bool, the foreground it was made with
    frame: Frame  # of the render
    reference: Reference  # of the same scene


def picture(settings: Settings, shot: Shot, name: str) -> Picture | None:
    """What method ``name`` makes of a render; None where its network has no weights."""
    method = weights.method(settings, name)
    if method is None:
        return None
    folder = renders.low_resolution(settings, shot)
    reference = Reference.read(renders.reference(settings, shot.scene))
    return Picture(*linear_and_mask(folder, method), read_frame(folder), reference)


def row(cells: Cells[Any], shot: Shot, name: str, key: str, measure: Callable[[Picture, Path], Any]) -> Any:
    """A kept record of what a method makes of a render, with its scene and method.

    Parameters
    ----------
    cells: where it is kept.
    shot: the render.
    name: of the method.
    key: file name of the record.
    measure: makes the record of a picture, and shows it in a file of the given path if it likes.

    Returns
    -------
    A record of class ``cells.kind``, without figures where the method's network has no weights.
    """
    def made() -> Any:
        seen = picture(cells.settings, shot, name)
        return seen and measure(seen, cells.folder / f"{key}.png")

    found = cells.get(key, inputs(cells.settings, shot, name), made) or cells.kind()
    return dataclasses.replace(found, scene=shot.scene.stem, method=name, samples=shot.spp)


def accuracy(seen: Picture, _file: Path | None = None) -> Row:
    """Metrics of a picture, where its error lies, and its split SSIM per foreground lens."""
    frame, reference = seen.frame, seen.reference
    check_reference(frame, reference.frame)
    metrics = compare(seen.image, (reference.half_a, reference.half_b), frame.display.lenses,
                      reference.foreground_mask(seen.mask), reference.lens_list)
    names = METRIC_NAMES if reference.lens_list is None else SAMPLED_NAMES
    return Row(metrics={name: metrics[name] for name in names}, ci95=metrics.get("ci95", {}),
               error=_errors(reference, seen.image, frame.scale),
               lens_ssim_fg=tuple(round(float(value), 6) for value in _per_lens(reference, seen.image)))


def second_stage_seconds(settings: Settings, folder: Path, method: Method) -> float:
    """Median seconds of the whole second stage short of writing files."""
    seconds = timing.take_turns({"": lambda: panel_image(folder, method)}, settings.repeats)
    return timing.median_ms(seconds[""]) / 1e3


def middle_lenses(reference: Reference, count: int) -> Array:
    """Indices into ``reference.lenses`` of the ``count`` foreground lenses nearest their centre, in reading order."""
    inside = np.flatnonzero(reference.foreground)
    inside = inside if len(inside) else np.arange(len(reference.lenses))
    centre = reference.lenses[inside].mean(0)
    near = np.argsort(((reference.lenses[inside] - centre) ** 2).sum(1), kind="stable")[:count]
    return inside[np.sort(near)]


def _per_lens(reference: Reference, image: Array) -> Array:
    """Split SSIM of the reference's foreground lenses each on its own, the same lenses for every image."""
    lenses = reference.frame.display.lenses
    rows, columns = reference.lenses[reference.foreground].T
    half_a, half_b = (half[reference.foreground] for half in reference.elemental_images())
    ours = srgb_encode(to_elemental_images(image, lenses)[rows, columns])
    return stacked_ssim(ours, half_a, half_b).mean((1, 2)) if len(rows) else np.empty(0)


def _errors(reference: Reference, image: Array, margin: int) -> SplitError | None:
    """Split squared error of foreground lenses in two parts that add up: ``margin`` outermost views, and the rest."""
    if not reference.foreground.any():
        return None
    rows, columns = reference.lenses.T
    ours = srgb_encode(to_elemental_images(image, reference.frame.display.lenses)[rows, columns][reference.foreground])
    half_a, half_b = (half[reference.foreground] for half in reference.elemental_images())
    squares = ((ours - half_a) * (ours - half_b)).mean((0, 3), dtype=np.float64)
    inside = np.zeros(squares.shape, bool)
    inside[margin:-margin, margin:-margin] = True
    border, centre = (float(squares[part].sum() / squares.size) for part in (~inside, inside))
    return SplitError(border, centre, border_pixels=float((~inside).mean()))


def inputs(settings: Settings, shot: Shot, name: str, **more: Any) -> dict[str, Any]:
    """What a kept measurement of accuracy depends on."""
    reference = read_frame(renders.reference(settings, shot.scene))
    return {"metrics": list(METRIC_NAMES),
            "scene": shot.scene.stem, "method": name, "display": settings.display.to_dict(), "scale": settings.scale,
            "convention": settings.convention, "reference_spp": reference.samples,
            "weights": weights.fingerprints(settings, name),
            "lenses": None if reference.lens_list is None else len(reference.lens_list), "spp": shot.spp, **more}


def schedules(settings: Settings, names: Iterable[str]) -> dict[str, str]:
    """How the network of each method was trained; methods without one are left out."""
    return {name: weights.schedule(weights.weights(settings, part)) for name in names
            for part in MethodName.parse(name).networks}
