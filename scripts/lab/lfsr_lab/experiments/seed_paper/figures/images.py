"""Fig. 9 and 11: what methods leave over of the reference, in elemental images and in epipolar images (EPIs)."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array, Mask
from lfsr_core.images.color import srgb_encode
from lfsr_core.images.image_files import read_png, write_png
from lfsr_core.optics.rays import to_elemental_images, to_views
from lfsr_core.reconstruct.methods import DEFAULT_METHOD
from lfsr_lab.experiments.engine import plots
from lfsr_lab.experiments.engine.records import Cell
from lfsr_lab.experiments.seed_paper import measuring
from lfsr_lab.experiments.seed_paper.figure import Figure, gains, overall, scenes_of, sentence
from lfsr_lab.experiments.seed_paper.measuring import ACCURACY, Finished, Row, Rows, Settings, View

METHODS = ("bicubic", "paper", "paper-gan")
PARTS = (("paper", "bicubic"), ("paper-gan", "paper"))
LENSES_SHOWN, AMPLIFIED = (3, 4), 4
CLAIM = "Generator with adversary is closer to the reference than the generator alone, and that closer than bicubic."
COLUMNS = ("ssim_eia", "ssim_eia_fg", "ssim_lens_fg", "psnr_fg", "ssim_views_fg", "ssim_eia_plain", "ssim_ceiling")
PAIRS = (("bicubic", "bicubic-eia"), ("paper", "paper-eia"), ("fsrcnn", "fsrcnn-eia"))
# Whole array and elemental image for each upscaler, then the adversary and this project's default.
EPI_METHODS = (*(name for pair in PAIRS for name in reversed(pair)), "paper-gan", DEFAULT_METHOD)
EPI, EPI_PSNR, REFERENCE = "squared error of EPIs", "EPI PSNR, dB", "reference"
EPI_CLAIM = ("Super-resolving each elemental image keeps the lines of epipolar images; super-resolving the whole EIA "
             "mixes neighbouring elemental images (crosstalk).")


def cells(settings: Settings) -> Iterator[Cell[Rows]]:
    """Yield every scene and method, at the samples a user has and nearly without noise."""
    for scene in settings.scenes:
        for spp in sorted({settings.spp, settings.clean_spp}):
            for name in METHODS:
                yield measuring.accuracy_cell(settings, "fig9", View(scene, spp), name, measure)


def measure(made: Finished) -> Row:
    """Measure, and show the amplified residual of some lenses in the middle of the foreground."""
    image, half_a, half_b = map(srgb_encode, (made.image, *made.truth.whole))
    residual = np.abs(image - (half_a + half_b) / 2) * AMPLIFIED
    write_image(made.file, residual[middle(made.truth.mask, made.frame.display.views)])
    return dataclasses.replace(measuring.accuracy(made), image=made.file.name)


def middle(mask: Mask, views: tuple[int, int]) -> tuple[slice, slice]:
    """Return rows and columns of pixels of LENSES_SHOWN lenses around the middle of a foreground (sy, sx)."""
    places = np.argwhere(mask) if mask.any() else np.argwhere(~mask)
    first = (places.mean(0) - np.array(LENSES_SHOWN) / 2).round().clip(0, np.array(mask.shape) - LENSES_SHOWN)
    top, left = (int(place) * size for place, size in zip(first, reversed(views), strict=True))
    return slice(top, top + LENSES_SHOWN[0] * views[1]), slice(left, left + LENSES_SHOWN[1] * views[0])


def write_image(path: Path, image: Array) -> None:
    write_png(path, (image.clip(0, 1) * 255).round().astype(np.uint8))


def draw(rows: Sequence[Row], folder: Path) -> plots.Figure:
    """Draw one row per scene and one column per method, at the most samples; above each its split SSIM."""
    scenes, most = scenes_of(rows), max(row.samples or 0 for row in rows)
    sheet, grid = plots.sheet(2.4 * len(METHODS), 1.9 * len(scenes), len(scenes), len(METHODS))
    for row in (row for row in rows if row.samples == most):
        axis = grid[scenes.index(row.scene), METHODS.index(row.method)]
        axis.set(xticks=[], yticks=[], frame_on=bool(row.image))
        axis.set_title(f"{row.method}  {row.text(ACCURACY) if row.image else 'no weights'}", fontsize=8)
        axis.set_ylabel(row.scene if row.method == METHODS[0] else "", fontsize=8)
        if row.image:
            axis.imshow(read_png(folder / row.image), interpolation="nearest")
    return sheet


def rule(rows: Sequence[Row]) -> str:
    """Return each half of the claim, at each number of samples."""
    samples = sorted({row.samples or 0 for row in rows})
    parts = {f"{more} above {less} at {spp} samples": gains([row for row in rows if row.samples == spp], more, less)
             for spp in samples for more, less in PARTS}
    words = [sentence(statement, gain, "split SSIM of foreground lenses") for statement, gain in parts.items()]
    return " ".join([overall(*parts.values()), *words])


def epi_cells(settings: Settings) -> Iterator[Cell[Rows]]:
    """Yield every scene and method, nearly without noise."""
    for scene in settings.scenes:
        for name in EPI_METHODS:
            yield measuring.accuracy_cell(settings, "fig11", View(scene, settings.clean_spp), name, measure_epis)


def measure_epis(made: Finished) -> Row:
    """Measure the squared error of all horizontal EPIs, row by row of lenses, and show that of the fullest row."""
    display, mask = made.frame.display, made.truth.mask
    image, half_a, half_b = map(srgb_encode, (made.image, *made.truth.whole))
    fullest = int(mask.sum(1).argmax())
    for path, shown in ((made.file, image), (_reference(made.file), (half_a + half_b) / 2)):
        write_image(path, to_views(shown, display.lenses)[display.views[1] // 2, :, fullest])
    squares = to_elemental_images(((image - half_a) * (image - half_b)).astype(np.float64), display.lenses)
    errors = tuple(float(squares[row][mask[row]].mean()) for row in np.flatnonzero(mask.any(1)))
    mean = float(np.mean(errors)) if errors else 0.0
    return Row(values={EPI_PSNR: -10 * float(np.log10(mean)) if mean > 0 else None}, series={EPI: errors},
               image=made.file.name)


def _reference(file: Path) -> Path:
    return file.with_name(f"{REFERENCE}-of-{file.name}")


def draw_epis(rows: Sequence[Row], folder: Path) -> plots.Figure:
    """Draw the EPI of the fullest row of lenses, views downwards, of the first scene, for every method."""
    scene = rows[0].scene
    shown = {row.method: folder / row.image for row in rows if row.scene == scene and row.image}
    shown = {REFERENCE: _reference(next(iter(shown.values()))), **shown}
    sheet, grid = plots.sheet(7, 1.1 * len(shown), len(shown), 1)
    for axis, (name, file) in zip(grid[:, 0], shown.items(), strict=True):
        axis.imshow(read_png(file), aspect="auto", interpolation="nearest")
        axis.set(xticks=[], yticks=[])
        axis.set_ylabel(name, rotation=0, ha="right", va="center", fontsize=8)
    sheet.suptitle(f"{scene}: lenses from left to right, views downwards", fontsize=8)
    return sheet


def rule_epis(rows: Sequence[Row]) -> str:
    """Return each upscaler per EI against itself over the whole array; then the adversary and the default."""
    claim = {f"{per_ei} per elemental image is nearer to the reference than over the whole array":
             gains(rows, whole, per_ei, EPI) for per_ei, whole in PAIRS}
    others = {f"{better} is nearer than the generator alone": gains(rows, "paper", better, EPI)
              for better in EPI_METHODS[-2:]}
    words = [sentence(statement, gain, "less squared error") for statement, gain in {**claim, **others}.items()]
    return " ".join([overall(*claim.values()), *words])


FIG9 = Figure("fig9", "Fig. 9: residuals", CLAIM, cells, COLUMNS, rule, draw, METHODS)
FIG11 = Figure("fig11", "Fig. 11: epipolar images", EPI_CLAIM, epi_cells, (EPI_PSNR,), rule_epis, draw_epis,
               EPI_METHODS)
