"""Fig. 11: epipolar images after upscaling the whole EIA as one photograph, or each elemental image on its own."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np

from lfsr_core.arrays import Array, Mask
from lfsr_core.frames.frame import read_frame
from lfsr_core.frames.reference import Reference
from lfsr_core.images.png import read_png, write_png
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.optics.eia import horizontal_epi, to_elemental_images
from lfsr_core.reconstruct.method_name import DEFAULT_METHOD
from lfsr_lab.experiments.engine import plots
from lfsr_lab.experiments.engine.records import Records
from lfsr_lab.experiments.engine.report import markdown_table, number
from lfsr_lab.experiments.paper import quality, renders
from lfsr_lab.experiments.paper.figure import Figure, cautions, differences
from lfsr_lab.experiments.paper.records import Row, Rows
from lfsr_lab.experiments.paper.renders import View
from lfsr_lab.experiments.paper.settings import CELLS, Settings
from lfsr_lab.experiments.paper.verdict import Difference, overall, sentence

ID = "fig11"
PAIRS = (("bicubic", "bicubic-eia"), ("paper", "paper-eia"), ("fsrcnn", "fsrcnn-eia"))
REFERENCE, ADVERSARIAL = "reference", "paper-gan"
UNIT = "× 10⁻³ mean squared error less"
CLAIM = ("Super-resolving each elemental image keeps the lines of epipolar images; super-resolving the whole EIA "
         "mixes neighbouring elemental images (crosstalk).")


def methods() -> tuple[str, ...]:
    """Whole array and elemental image for each upscaler, then this project's default."""
    return (*(name for pair in PAIRS for name in reversed(pair)), ADVERSARIAL, DEFAULT_METHOD)


def measure(settings: Settings) -> Rows:
    """Measure the error of all horizontal EPIs, lens row by lens row; needs a reference of all lenses."""
    records = quality.records_of(settings, ID, Row)
    rows = tuple(_row(settings, records, View(scene, settings.scale, settings.clean_spp), name)
                 for scene in settings.scenes for name in methods())
    return Rows(rows=rows, samples=(settings.clean_spp,), load=records.load,
                schedules=quality.schedules(settings, methods()))


def _row(settings: Settings, records: Records[Row], view: View, name: str) -> Row:
    scene = view.scene.stem
    if read_frame(renders.reference(settings, view.scene)).lens_list is not None:
        return Row(scene=scene, method=name, reason="sampled lenses have no epipolar images")
    return quality.row(settings, records, view, name, f"{scene}-{name}", functools.partial(_measure_one, scene))


def _measure_one(scene: str, seen: quality.Finished, file: Path) -> Row:
    image, half_a, half_b = map(srgb_encode, (seen.image, *seen.target.halves))
    reference = seen.target.reference
    _write_epi(image, reference, file)
    _write_epi((half_a + half_b) / 2, reference, file.with_name(f"{scene}-{REFERENCE}.png"))
    epi, border = epi_errors((image - half_a) * (image - half_b), reference.hits, seen.frame.scale)
    return Row(epi=epi, epi_border=border, picture=file.name)


def epi_errors(squares: Array, hits: Mask, scale: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return means by lens row of split squared errors (H, W, 3), over the foreground ``hits`` (sy, sx).

    The border are the ``scale`` outermost views on either side.
    """
    images = to_elemental_images(squares.astype(np.float64), (hits.shape[1], hits.shape[0]))
    border = np.concatenate([images[..., :scale, :], images[..., -scale:, :]], axis=-2)
    rows = np.flatnonzero(hits.any(1))
    whole, outer = (tuple(float(part[row][hits[row]].mean()) for row in rows) for part in (images, border))
    return whole, outer


def _write_epi(image: Array, reference: Reference, path: Path) -> None:
    display, lens_row = reference.frame.display, int(reference.hits.sum(1).argmax())
    epi = horizontal_epi(image, display.lenses, lens_row, display.views[1] // 2)
    write_png(path, (epi.clip(0, 1) * 255).round().astype(np.uint8))


def draw(results: Rows, output: Path) -> plots.Figure:
    """The EPI of the fullest lens row, views downwards, of the first scene, for every method."""
    scene = next((row.scene for row in results.rows if row.picture), "no scene")
    shown = [(row.method, row.picture) for row in results.rows if row.scene == scene and row.picture]
    shown = [(REFERENCE, f"{scene}-{REFERENCE}.png"), *shown] if shown else []
    sheet, grid = plots.sheet(7, 1.1 * max(1, len(shown)), max(1, len(shown)), 1)
    for axis, (name, picture) in zip(grid[:, 0], shown, strict=False):
        axis.imshow(read_png(output / CELLS / ID / picture), aspect="auto", interpolation="nearest")
        axis.set(xticks=[], yticks=[])
        axis.set_ylabel(name, rotation=0, ha="right", va="center", fontsize=8)
    sheet.suptitle(f"{scene}: lenses from left to right, views downwards", fontsize=8)
    return sheet


def table(results: Rows) -> list[str]:
    """Return a table of PSNR of the EPIs, and of their border views."""
    rows = [[row.scene, row.method, _decibels(row.epi), _decibels(row.epi_border)]
            for row in results.rows if row.epi]
    return markdown_table(["scene", "method", "EPI PSNR, dB", "of border views, dB"], rows)


def _decibels(errors: tuple[float, ...]) -> str:
    mean = float(np.mean(errors)) if errors else 0.0
    return number(-10 * float(np.log10(mean)) if mean > 0 else None, digits=2)


def _less_error(results: Rows, better: str, worse: str, name: str = "epi") -> dict[str, Difference]:
    """By how much ``better`` has the smaller error, per lens row, for every scene that has both."""
    return differences(results.rows, worse, better, lambda row: getattr(row, name))


def line(results: Rows) -> str:
    """Return sentences on each upscaler per EI against itself over the whole array, and on the default method."""
    found = {per_ei: _less_error(results, per_ei, whole) for per_ei, whole in PAIRS}
    words = [overall(*found.values())]
    for per_ei, whole in PAIRS:
        statement = f"{per_ei} per elemental image is nearer to the reference than over the whole array"
        words.append(sentence(statement, found[per_ei], UNIT, 1e3))
        border = _less_error(results, per_ei, whole, "epi_border")
        words.append(sentence("In the border views", border, UNIT, 1e3) if border else "")
    for better in (ADVERSARIAL, DEFAULT_METHOD):
        statement = f"{better} is nearer than the generator alone"
        words.append(sentence(statement, _less_error(results, better, "paper"), UNIT, 1e3))
    tried = [row for row in results.rows if row.reason is None]
    return " ".join(filter(None, words)) + _left_out(results) + cautions(tried, results.schedules)


def _left_out(results: Rows) -> str:
    reasons = {row.scene: row.reason for row in results.rows if row.reason}
    return "".join(f" {scene} was not measured: {reason}." for scene, reason in reasons.items())


FIGURE = Figure(ID, "Fig. 11: epipolar images", CLAIM, Rows, measure, table, line, draw)
