"""Fig. 11: epipolar images after upscaling the whole EIA as one photograph, or each elemental image on its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.bench.paper import quality, renders, weights
from lfsr_core.bench.paper.cells import Cells
from lfsr_core.bench.paper.figure import Figure, Results, axes, markdown, missing, number, save, unequal
from lfsr_core.bench.paper.settings import Settings
from lfsr_core.bench.paper.verdict import Difference, overall, paired, say
from lfsr_core.frames.frame import read_frame
from lfsr_core.optics.eia import horizontal_epi, to_elemental_images
from lfsr_core.reconstruct.method_name import DEFAULT_METHOD
from lfsr_core.reconstruct.second_stage import finished_linear

PAIRS = (("bicubic", "bicubic-eia"), ("paper", "paper-eia"), ("fsrcnn", "fsrcnn-eia"))
TRUTH, ADVERSARIAL = "reference", "paper-gan"
UNIT = "× 10⁻³ mean squared error less"
LEAST_HEIGHT = 80
CLAIM = ("Super-resolving each elemental image keeps the lines of epipolar images; super-resolving the whole EIA "
         "mixes neighbouring elemental images (crosstalk).")


def methods() -> tuple[str, ...]:
    """Whole array and elemental image for each upscaler, then this project's default."""
    return (*(name for pair in PAIRS for name in reversed(pair)), ADVERSARIAL, DEFAULT_METHOD)


def measure(settings: Settings, folder: Path) -> Results:
    """Error of all horizontal EPIs, lens row by lens row; needs a reference of all lenses."""
    cells = Cells(folder, "fig11")
    rows = [_row(settings, cells, scene, name) for scene in settings.scenes for name in methods()]
    return {"rows": rows, "samples": settings.clean_spp, "default": DEFAULT_METHOD,
            "load": cells.load, "schedules": quality.schedules(settings, methods())}


def _row(settings: Settings, cells: Cells, scene: Path, name: str) -> dict[str, Any]:
    if read_frame(renders.reference(settings, scene)).lens_list is not None:
        return {"scene": scene.stem, "method": name, "reason": "sampled lenses have no epipolar images"}
    picture = cells.folder / f"{scene.stem}-{name}.png"
    inputs = quality.inputs(settings, scene, name, spp=settings.clean_spp)
    found = cells(picture.stem, inputs, lambda: _measure_one(settings, scene, name, picture))
    return {"scene": scene.stem, "method": name, **(found or {})}


def _measure_one(settings: Settings, scene: Path, name: str, picture: Path) -> dict[str, Any] | None:
    method = weights.method(settings, name)
    if method is None:
        return None
    folder = renders.low_resolution(settings, scene, settings.scale, settings.clean_spp)
    image = quality.srgb_encode(finished_linear(folder, method))
    reference = quality.Reference.read(renders.reference(settings, scene))
    half_a, half_b = (quality.srgb_encode(half) for half in (reference.half_a, reference.half_b))
    _write_epi(image, reference, picture)
    _write_epi((half_a + half_b) / 2, reference, picture.with_name(f"{scene.stem}-{TRUTH}.png"))
    return {"metrics": epi_errors(image, half_a, half_b, reference.hits, settings.scale), "picture": picture.name}


def epi_errors(image: np.ndarray, half_a: np.ndarray, half_b: np.ndarray, hit: np.ndarray,
               scale: int) -> dict[str, Any]:
    """Split squared errors of display values, EIAs (H, W, 3), mean over the foreground lenses of each lens row.

    ``epi``: of all views; ``epi_border``: of the ``scale`` outermost views on
    either side, where a neighbour's light would show. ``hit``: foreground (sy, sx).
    """
    lenses = hit.shape[::-1]
    product = (image - half_a) * (image - half_b)
    squares = to_elemental_images(product.astype(np.float64), lenses)
    border = np.concatenate([squares[..., :scale, :], squares[..., -scale:, :]], axis=-2)
    rows = [row for row in range(len(hit)) if hit[row].any()]
    return {"epi": [float(squares[row][hit[row]].mean()) for row in rows],
            "epi_border": [float(border[row][hit[row]].mean()) for row in rows]}


def _write_epi(image: np.ndarray, reference: quality.Reference, path: Path) -> None:
    from lfsr_core.images.png import write_png

    lens_row = int(reference.hits.sum(1).argmax())
    epi = horizontal_epi(image, reference.frame.display.lenses, lens_row, reference.frame.display.views[1] // 2)
    write_png(path, (epi.clip(0, 1) * 255).round().astype(np.uint8))


def draw(results: Results, output: Path, path: Path) -> None:
    """The EPI of the fullest lens row, views downwards, of the first scene, for every method."""
    from lfsr_core.images.png import read_png

    scene = next((row["scene"] for row in results["rows"] if "picture" in row), "no scene")
    shown = [(row["method"], row["picture"]) for row in results["rows"] if row["scene"] == scene and "picture" in row]
    shown = [(TRUTH, f"{scene}-{TRUTH}.png"), *shown] if shown else []
    sheet, grid = axes(7, 1.1 * max(1, len(shown)), max(1, len(shown)), 1)
    for axis, (name, picture) in zip(grid[:, 0], shown, strict=False):
        axis.imshow(read_png(Path(output) / "cells" / "fig11" / picture), aspect="auto", interpolation="nearest")
        axis.set_xticks([])
        axis.set_yticks([])
        axis.set_ylabel(name, rotation=0, ha="right", va="center", fontsize=8)
    sheet.suptitle(f"{scene}: lenses from left to right, views downwards", fontsize=8)
    save(sheet, path)


def table(results: Results) -> list[str]:
    """PSNR of the EPIs, and of their border views."""
    rows = [[row["scene"], row["method"], *(_decibels(row["metrics"][name]) for name in ("epi", "epi_border"))]
            for row in results["rows"] if row.get("metrics")]
    return markdown(["scene", "method", "EPI PSNR, dB", "of border views, dB"], rows)


def _decibels(errors: list[float]) -> str:
    mean = float(np.mean(errors)) if errors else 0.0
    return number(-10 * float(np.log10(mean)) if mean > 0 else None, digits=2)


def less_error(results: Results, better: str, worse: str, name: str = "epi") -> dict[str, Difference]:
    """By how much ``better`` has the smaller error, per lens row, for every scene that has both."""
    found = {(row["scene"], row["method"]): row["metrics"][name] for row in results["rows"] if row.get("metrics")}
    scenes = dict.fromkeys(scene for scene, _ in found)
    return {scene: paired(found[scene, worse], found[scene, better]) for scene in scenes
            if found.get((scene, better)) and found.get((scene, worse))}


def line(results: Results) -> str:
    """Each upscaler per EI against itself over the whole array; then the default against the paper's."""
    found = {per_ei: less_error(results, per_ei, whole) for per_ei, whole in PAIRS}
    words = [overall(*found.values())]
    for per_ei, whole in PAIRS:
        statement = f"{per_ei} per elemental image is nearer to the truth than over the whole array"
        words.append(say(statement, found[per_ei], UNIT, 1e3))
        border = less_error(results, per_ei, whole, "epi_border")
        words.append(say("In the border views", border, UNIT, 1e3) if border else "")
    for better in (ADVERSARIAL, results["default"]):
        statement = f"{better} is nearer than the generator alone"
        words.append(say(statement, less_error(results, better, "paper"), UNIT, 1e3))
    whole = [row for row in results["rows"] if "reason" not in row]
    return " ".join(filter(None, words)) + _left_out(results) + missing(whole) + unequal(results["schedules"])


def _left_out(results: Results) -> str:
    reasons = {row["scene"]: row["reason"] for row in results["rows"] if "reason" in row}
    return "".join(f" {scene} was not measured: {reason}." for scene, reason in reasons.items())


FIGURE = Figure("fig11", "Fig. 11: epipolar images", CLAIM, measure, draw, table, line)
