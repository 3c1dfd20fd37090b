"""Elemental images side by side, chosen by rule: at equal cost and at equal error, where methods differ most and least.

Ours is held against direct rendering with OIDN at its most samples. Of the measured samples ours has those whose cost
comes nearest (equal time, or equal rays where nothing was timed), and those whose error comes nearest. Over all scenes
and foreground lenses the difference is HDR-FLIP of the rival minus that of ours, means over seeds; shown are the lens
of the largest difference, of the median one and of the smallest, each with the render of seed 0.
"""

from __future__ import annotations

import dataclasses
import io
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.images.srgb import srgb_encode
from lfsr_lab.experiments.chart import cells
from lfsr_lab.experiments.chart.analysis import LOW, Cell, Chart, SceneRow
from lfsr_lab.experiments.chart.cells import Settings
from lfsr_lab.experiments.chart.findings import RIVAL, label
from lfsr_lab.experiments.engine import plots
from lfsr_lab.experiments.engine.renders import REFERENCE
from lfsr_lab.experiments.engine.truth import FLIP, Truth, flip_map

RULES = {"largest": -1, "median": 0.5, "smallest": 0}
FLIP_MOST = 0.7  # HDR-FLIP that is drawn white


@dataclasses.dataclass(frozen=True)
class Row:
    """One lens, as both methods show it."""

    title: str  # kind of equality, rule, scene and lens
    names: tuple[str, str]  # ours and the rival, with samples
    errors: tuple[float, float]  # HDR-FLIP of this lens, means over seeds
    reference: Array  # (py, px, 3) scene-linear, mean of both halves
    images: tuple[Array, Array]  # (py, px, 3) scene-linear, of seed 0


@dataclasses.dataclass(frozen=True)
class Crops:
    rows: tuple[Row, ...]

    def png(self) -> bytes:
        """Return the picture: reference, both images and both error maps of every row."""
        figure, grid = plots.sheet(10.5, 2.35 * len(self.rows), len(self.rows), 5)
        for axes, row in zip(grid, self.rows, strict=True):
            maps = [flip_map(image, row.reference) for image in row.images]
            shown = [srgb_encode(image) for image in (row.reference, *row.images)]
            titles = ["reference", *row.names, *(f"HDR-FLIP {error:.3f}" for error in row.errors)]
            for place, picture, title in zip(axes, [*shown, *maps], titles, strict=True):
                place.imshow(picture, cmap="magma", vmin=0, vmax=FLIP_MOST, interpolation="nearest")
                place.set_title(plots.broken(title), fontsize=9)
                place.set_xticks([])
                place.set_yticks([])
            axes[0].set_ylabel(row.title, fontsize=9)
        file = io.BytesIO()
        figure.savefig(file, dpi=plots.DPI, metadata={"Software": None}, pil_kwargs={"optimize": True})
        return file.getvalue()


def chosen(chart: Chart, settings: Settings, scenes: Sequence[Path]) -> Crops | None:
    """Return the crops of a chart; None where ours or the rival was not measured on every scene."""
    pairs = [_pairs(chart, row) for row in chart.scenes]
    if not all(pairs):
        return None
    rows = []
    for kind in pairs[0]:
        found = [(difference, path, pair[kind], index) for path, pair in zip(scenes, pairs, strict=True)
                 for index, difference in enumerate(_differences(settings, path, pair[kind]))]
        found.sort(key=lambda each: each[0])
        for rule, share in RULES.items():
            _, path, pair, index = found[-1 if share < 0 else math.floor(share * (len(found) - 1))]
            rows.append(_row(settings, path, pair, index, f"{kind}\n{rule} difference", chart.settings.ours))
    return Crops(tuple(rows))


Pair = tuple[Cell, Cell]  # of ours and of the rival


def _pairs(chart: Chart, scene: SceneRow) -> dict[str, Pair]:
    """Return the cells that are compared, by kind of equality."""
    ours = [cell for cell in scene.cells if cell.key == (LOW, chart.settings.ours)]
    rival = max((cell for cell in scene.cells if cell.key == RIVAL), key=lambda cell: cell.samples, default=None)
    if not ours or rival is None:
        return {}

    def nearest(of: Callable[[Cell], float]) -> Pair:
        return min(ours, key=lambda cell: abs(math.log(of(cell) / of(rival)))), rival

    cost = ("equal time", lambda cell: cell.seconds.mean) if chart.timed else ("equal rays", lambda cell: cell.rays)
    return {cost[0]: nearest(cost[1]), "equal error": nearest(lambda cell: cell.errors[FLIP].mean)}


def _differences(settings: Settings, scene: Path, pair: Pair) -> Array:
    """Return the HDR-FLIP of the rival minus that of ours, by lens."""
    ours, rival = (_flips(settings, scene, cell) for cell in pair)
    return rival - ours


def _flips(settings: Settings, scene: Path, cell: Cell) -> Array:
    render = _render(settings, scene, cell)
    values = cells.measured(render, cell.method, Truth(settings.output / scene.stem / REFERENCE)).values
    return np.mean(values[FLIP], 0)


def _render(settings: Settings, scene: Path, cell: Cell) -> cells.Render:
    return next(render for render in cells.renders(settings, scene)
                if (render.role, render.jobs[0].sampling.samples) == (cell.role, cell.samples))


def _row(settings: Settings, scene: Path, pair: Pair, index: int, title: str, ours: str) -> Row:
    truth = Truth(settings.output / scene.stem / REFERENCE)
    images = [truth.finished(_render(settings, scene, cell).folders[0], cell.method)[index] for cell in pair]
    names = [f"{name}, {cell.samples} samples" for name, cell in zip(("ours", label(RIVAL, ours)), pair, strict=True)]
    errors = [float(_flips(settings, scene, cell)[index]) for cell in pair]
    mean = (truth.halves[0][index] + truth.halves[1][index]) / 2
    return Row(f"{title}\n{scene.stem}", (names[0], names[1]), (errors[0], errors[1]), mean, (images[0], images[1]))
