"""Fig. 9: what bicubic, the generator, and the generator trained with its adversary leave over."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.bench.paper import quality, renders, weights
from lfsr_core.bench.paper.cells import Cells
from lfsr_core.bench.paper.figure import Figure, Results, axes, gains, markdown, metric, missing, save, unequal
from lfsr_core.bench.paper.settings import Settings
from lfsr_core.bench.paper.verdict import Difference, overall, say
from lfsr_core.reconstruct.second_stage import linear_and_mask

METHODS = ("bicubic", "paper", "paper-gan")
LENSES_SHOWN, ACROSS, AMPLIFIED = 12, 4, 4
PADDING = "borders, where zeros are padded, are a part of the reason"
NOTABLE = 1.5  # times the others' error per pixel that border views must have to be a reason
PARTS = (("paper", "bicubic"), ("paper-gan", "paper"))
CLAIM = "Generator with adversary is closer to the truth than the generator alone, and that closer than bicubic."


def measure(settings: Settings, folder: Path) -> Results:
    """Every scene, at the samples a user has and nearly without noise."""
    cells = Cells(folder, "fig9")
    rows = [_row(settings, cells, scene, spp, name)
            for scene in settings.scenes for spp in _samples(settings) for name in METHODS]
    return {"rows": rows, "samples": _samples(settings), "load": cells.load,
            "schedules": quality.schedules(settings, METHODS)}


def _samples(settings: Settings) -> list[int]:
    return sorted({settings.spp, settings.clean_spp})


def _row(settings: Settings, cells: Cells, scene: Path, spp: int, name: str) -> dict[str, Any]:
    picture = cells.folder / f"{scene.stem}-spp{spp}-{name}.png"
    inputs = quality.inputs(settings, scene, name, spp=spp)
    found = cells(picture.stem, inputs, lambda: _measure_one(settings, scene, spp, name, picture))
    return {"scene": scene.stem, "samples": spp, "method": name, **(found or {})}


def _measure_one(settings: Settings, scene: Path, spp: int, name: str, picture: Path) -> dict[str, Any] | None:
    method = weights.method(settings, name)
    if method is None:
        return None
    folder = renders.low_resolution(settings, scene, settings.scale, spp)
    image, mask = linear_and_mask(folder, method)
    reference = quality.Reference.read(renders.reference(settings, scene))
    _write_residual(reference, image, picture)
    found = quality.against(reference, quality.read_frame(folder), image, mask)
    return {**found, "picture": picture.name}


def _write_residual(reference: quality.Reference, image: np.ndarray, path: Path) -> None:
    """Amplified difference from the mean of the halves, of foreground lenses side by side."""
    from lfsr_core.images.png import write_png

    shown = quality.middle_lenses(reference, LENSES_SHOWN)
    rows, columns = reference.lenses[shown].T
    ours = quality.srgb_encode(quality.to_elemental_images(image, reference.frame.display.lenses)[rows, columns])
    half_a, half_b = (half[shown] for half in reference.elemental_images())
    residual = np.abs(ours - (half_a + half_b) / 2) * AMPLIFIED
    write_png(path, (mosaic(residual).clip(0, 1) * 255).round().astype(np.uint8))


def mosaic(images: np.ndarray, across: int = ACROSS) -> np.ndarray:
    """(n, h, w, C) images side by side, the last row filled with zeros."""
    count, height, width, channels = images.shape
    down = -(-count // across)
    padded = np.zeros((down * across, height, width, channels), images.dtype)
    padded[:count] = images
    return padded.reshape(down, across, height, width, channels).swapaxes(1, 2).reshape(
        down * height, across * width, channels)


def draw(results: Results, output: Path, path: Path) -> None:
    """One row per scene, one column per method, at the most samples; above each its split SSIM."""
    from lfsr_core.images.png import read_png

    rows = [row for row in results["rows"] if row["samples"] == results["samples"][-1]]
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    sheet, grid = axes(2.4 * len(METHODS), 1.9 * len(scenes), len(scenes), len(METHODS))
    for row in rows:
        axis = grid[scenes.index(row["scene"]), METHODS.index(row["method"])]
        axis.set_xticks([])
        axis.set_yticks([])
        if row["method"] == METHODS[0]:
            axis.set_ylabel(row["scene"], fontsize=8)
        if row.get("metrics"):
            axis.imshow(read_png(Path(output) / "cells" / "fig9" / row["picture"]), interpolation="nearest")
            axis.set_title(f"{row['method']}  {metric(row, 'ssim_eia_fg')}", fontsize=8)
        else:
            axis.set_title(f"{row['method']}: no weights", fontsize=8)
            axis.set_frame_on(False)
    save(sheet, path)


def table(results: Results) -> list[str]:
    """Metrics of every scene, sample count and method."""
    names = ("ssim_eia", "ssim_eia_fg", "psnr_fg", "ssim_views_fg", "ssim_eia_plain", "ssim_ceiling")
    rows = [[row["scene"], row["samples"], row["method"], *(metric(row, name) for name in names)]
            for row in results["rows"] if row.get("metrics")]
    return markdown(["scene", "samples", "method", *names], rows)


def line(results: Results) -> str:
    """Each half of the claim, at each number of samples."""
    parts = {(spp, better, worse): gains(results["rows"], better, worse, samples=spp)
             for spp in results["samples"] for better, worse in PARTS}
    words = [say(f"{better} above {worse} at {spp} samples", found, "split SSIM of foreground lenses")
             for (spp, better, worse), found in parts.items()]
    return " ".join([overall(*parts.values()), *words, *_why(results, parts)]) + missing(results["rows"]) + unequal(
        results["schedules"])


def _why(results: Results, parts: dict[tuple[int, str, str], dict[str, Difference]]) -> list[str]:
    """Where the generator loses to bicubic: with noise only, or without it too, and in which part of an EI."""
    few, many = results["samples"][0], results["samples"][-1]
    lost = {spp: [scene for scene, gain in parts[spp, "paper", "bicubic"].items() if gain.sign < 0]
            for spp in (few, many)}
    words = []
    only_noise = [scene for scene in lost[few] if scene not in lost[many]]
    if only_noise and few != many:
        words.append(f"It loses only with noise, which it was not trained on, on {', '.join(only_noise)}.")
    if lost[many]:
        words.append(f"It loses without noise too on {', '.join(lost[many])}.")
        words += _at_borders(results["rows"], lost[many], many)
    return words


def _at_borders(rows: list[dict[str, Any]], scenes: list[str], spp: int) -> list[str]:
    """Whether the squared error that the generator adds to bicubic's gathers near the borders of EIs."""
    found = {(row["scene"], row["method"]): row["error"] for row in rows
             if row["samples"] == spp and row["scene"] in scenes and row.get("error")}
    border, centre = (sum(found[scene, "paper"][part] - found[scene, "bicubic"][part] for scene in scenes)
                      for part in ("border", "centre"))
    if border + centre <= 0:
        return ["Its squared error is no larger there: SSIM punishes it for its structure."]
    if centre <= 0:
        return [f"All of its additional squared error lies in the outermost views of the elemental images: {PADDING}."]
    share = found[scenes[0], "paper"]["border_pixels"]
    ratio = (border / share) / (centre / (1 - share))
    reason = PADDING if ratio > NOTABLE else "borders are not the reason"
    return [f"Its additional squared error per pixel is {ratio:.1f} times as large in the outermost views of the "
            f"elemental images as in the others: {reason}."]


FIGURE = Figure("fig9", "Fig. 9: residuals", CLAIM, measure, draw, table, line)
