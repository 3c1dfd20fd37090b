"""Fig. 9: what bicubic, the generator, and the generator trained with its adversary leave over."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.images.png import read_png, write_png
from lfsr_lab.experiments.engine import plots
from lfsr_lab.experiments.engine.report import markdown_table
from lfsr_lab.experiments.paper import quality
from lfsr_lab.experiments.paper.figure import Figure, cautions, gains, known, main_metric, metric, scenes_of
from lfsr_lab.experiments.paper.records import Row, Rows
from lfsr_lab.experiments.paper.renders import View
from lfsr_lab.experiments.paper.settings import CELLS, Settings
from lfsr_lab.experiments.paper.verdict import Difference, overall, sentence

ID = "fig9"
METHODS = ("bicubic", "paper", "paper-gan")
LENSES_SHOWN, ACROSS, AMPLIFIED = 12, 4, 4
PADDING = "borders, where zeros are padded, are a part of the reason"
NOTABLE = 1.5  # times the others' error per pixel that border views must have to be a reason
PARTS = (("paper", "bicubic"), ("paper-gan", "paper"))
CLAIM = "Generator with adversary is closer to the reference than the generator alone, and that closer than bicubic."
COLUMNS = ("ssim_eia", "ssim_eia_fg", "ssim_lens", "ssim_lens_fg", "psnr_fg", "ssim_views_fg", "ssim_eia_plain",
           "ssim_ceiling", "ssim_lens_plain", "ssim_lens_ceiling")


def measure(settings: Settings) -> Rows:
    """Measure every scene, at the samples a user has and nearly without noise."""
    records, samples = quality.records_of(settings, ID, Row), tuple(sorted({settings.spp, settings.clean_spp}))
    views = [View(scene, settings.scale, spp) for scene in settings.scenes for spp in samples]
    rows = tuple(quality.row(settings, records, view, name, f"{view.scene.stem}-spp{view.spp}-{name}", _measure_one)
                 for view in views for name in METHODS)
    return Rows(rows=rows, samples=samples, load=records.load, schedules=quality.schedules(settings, METHODS))


def _measure_one(seen: quality.Finished, file: Path) -> Row:
    """Measure, and show the amplified difference from the mean of the halves, of foreground lenses side by side."""
    reference, shown = seen.target.reference, np.zeros(len(seen.target.reference.lenses), bool)
    shown[quality.middle_lenses(reference, LENSES_SHOWN)] = True
    ours, half_a, half_b = seen.target.listed(seen.image, shown)
    residual = np.abs(ours - (half_a + half_b) / 2) * AMPLIFIED
    write_png(file, (mosaic(residual).clip(0, 1) * 255).round().astype(np.uint8))
    return dataclasses.replace(quality.accuracy(seen), picture=file.name)


def mosaic(images: Array, across: int = ACROSS) -> Array:
    """Return (n, h, w, C) images side by side, the last row filled with zeros."""
    from einops import rearrange

    missing = -len(images) % across
    return rearrange(np.pad(images, ((0, missing), (0, 0), (0, 0), (0, 0))),
                     "(down across) h w c -> (down h) (across w) c", across=across)


def draw(results: Rows, output: Path) -> plots.Figure:
    """Draw one row per scene, one column per method, at the most samples; above each its split SSIM."""
    rows = results.at(results.samples[-1])
    scenes = scenes_of(rows)
    sheet, grid = plots.sheet(2.4 * len(METHODS), 1.9 * len(scenes), len(scenes), len(METHODS))
    for row in rows:
        axis = grid[scenes.index(row.scene), METHODS.index(row.method)]
        axis.set(xticks=[], yticks=[])
        if row.method == METHODS[0]:
            axis.set_ylabel(row.scene, fontsize=8)
        if row.picture:
            axis.imshow(read_png(output / CELLS / ID / row.picture), interpolation="nearest")
            axis.set_title(f"{row.method}  {metric(row, main_metric(rows))}", fontsize=8)
        else:
            axis.set_title(f"{row.method}: no weights", fontsize=8)
            axis.set_frame_on(False)
    return sheet


def table(results: Rows) -> list[str]:
    """Return a table of metrics of every scene, sample count and method."""
    columns = known(results.rows, COLUMNS)
    rows = [[row.scene, row.samples, row.method, *(metric(row, name) for name in columns)]
            for row in results.rows if row.metrics]
    return markdown_table(["scene", "samples", "method", *columns], rows)


def line(results: Rows) -> str:
    """Return sentences on each half of the claim, at each number of samples."""
    parts = {(spp, better, worse): gains(results.at(spp), better, worse)
             for spp in results.samples for better, worse in PARTS}
    words = [sentence(f"{better} above {worse} at {spp} samples", found, "split SSIM of foreground lenses")
             for (spp, better, worse), found in parts.items()]
    return " ".join([overall(*parts.values()), *words, *_why(results, parts)]) + cautions(results.rows,
                                                                                         results.schedules)


def _why(results: Rows, parts: dict[tuple[int, str, str], dict[str, Difference]]) -> list[str]:
    """Where the generator loses to bicubic: with noise only, or without it too, and in which part of an EI."""
    few, many = results.samples[0], results.samples[-1]
    lost = {spp: [scene for scene, gain in parts[spp, "paper", "bicubic"].items() if gain.sign < 0]
            for spp in (few, many)}
    words = []
    only_noise = [scene for scene in lost[few] if scene not in lost[many]]
    if only_noise and few != many:
        words.append(f"It loses only with noise, which it was not trained on, on {', '.join(only_noise)}.")
    if lost[many]:
        words.append(f"It loses without noise too on {', '.join(lost[many])}.")
        words += _at_borders(results.at(many), lost[many])
    return words


def _at_borders(rows: Sequence[Row], scenes: Sequence[str]) -> list[str]:
    """Whether the squared error that the generator adds to bicubic's gathers near the borders of EIs."""
    found = {(row.scene, row.method): row.error for row in rows if row.error}
    border, centre = (sum(getattr(found[scene, "paper"], part) - getattr(found[scene, "bicubic"], part)
                          for scene in scenes) for part in ("border", "centre"))
    if border + centre <= 0:
        return ["Its squared error is no larger there: SSIM punishes it for its structure."]
    if centre <= 0:
        return [f"All of its additional squared error lies in the outermost views of the elemental images: {PADDING}."]
    share = found[scenes[0], "paper"].border_pixels
    ratio = (border / share) / (centre / (1 - share))
    reason = PADDING if ratio > NOTABLE else "borders are not the reason"
    return [f"Its additional squared error per pixel is {ratio:.1f} times as large in the outermost views of the "
            f"elemental images as in the others: {reason}."]


FIGURE = Figure(ID, "Fig. 9: residuals", CLAIM, Rows, measure, table, line, draw)
