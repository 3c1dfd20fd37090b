"""Fit the model of the choice to a table: what its choices lose against the best scale at equal rays."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.optics.depth_scale import LEAST_SAMPLES, LossModel, choose_scale
from lfsr_core.optics.display import load_display
from lfsr_lab.experiments.scales.table import Cell, Table

ENOUGH = 0.005  # loss that a choice may have
TOO_MUCH = 4.0  # times a loss beyond that counts
RATIOS, LENSES, POWERS = np.geomspace(0.5, 50, 41), np.geomspace(0.25, 16, 25), np.linspace(0.3, 1.5, 25)
DISPLAY = load_display("small")  # full parallax: all that the choice asks for


@dataclasses.dataclass(frozen=True)
class Group:
    """One scene with one number of rays."""

    scene: str
    rays: float
    moves: Array  # (n,)
    ssims: dict[int, float]  # by scale

    @property
    def best(self) -> int:
        """The scale with the highest accuracy."""
        return max(self.ssims, key=lambda scale: self.ssims[scale])

    def chosen(self, model: LossModel) -> int:
        """The scale that `--scale auto` would take."""
        return choose_scale(DISPLAY, self.moves, self.ssims, self.rays, model).scale

    def lost(self, model: LossModel) -> float:
        """What the choice loses against the best scale."""
        return max(self.ssims.values()) - self.ssims[self.chosen(model)]


@dataclasses.dataclass(frozen=True)
class Fit:
    """A fitted model, and how good it is on scenes that it was not fitted to."""

    model: LossModel
    left_out: dict[tuple[str, float], float]  # loss of each scene and number of rays by the model of all other scenes


def groups_of(table: Table) -> list[Group]:
    """Return the scenes of a table with their numbers of rays."""
    def key(cell: Cell) -> tuple[float, str]:
        return cell.rays, cell.scene

    return [Group(scene, rays, np.array(table.moves[scene]), {cell.scale: cell.ssim for cell in cells})
            for (rays, scene), cells in itertools.groupby(sorted(table.cells, key=key), key)]


def fit(groups: list[Group]) -> Fit:
    """Return the model of a grid whose choices lose least, and of equal ones the one that predicts differences best.

    Each loss beyond ENOUGH counts TOO_MUCH times more.
    """
    lost, errors, models = (np.concatenate(part) for part in zip(*_grid(groups), strict=True))
    weighed = lost + TOO_MUCH * np.maximum(lost - ENOUGH, 0)
    left_out = {}
    for index, group in enumerate(groups):
        others = [other.scene != group.scene for other in groups]
        left_out[group.scene, group.rays] = float(lost[_best(weighed[:, others], errors[:, others]), index])
    detail, lenses, noise, power = models[_best(weighed, errors)].tolist()
    return Fit(LossModel(detail, lenses, noise, power), left_out)


def _best(weighed: Array, errors: Array) -> int:
    """Return the row with the least mean loss; of nearly equal ones, with the least squared error."""
    means = weighed.mean(1)
    near = means <= means.min() + 1e-6
    return int(np.argmin(np.where(near, errors.mean(1), np.inf)))


def _grid(groups: list[Group]) -> Iterator[tuple[Array, Array, Array]]:
    """Yield, for models of a grid, losses and squared errors (m, groups) and the models' numbers (m, 4)."""
    for lenses, power in itertools.product(LENSES, POWERS):
        lost, errors = np.empty((2, len(RATIOS), len(groups)))
        products, squares = np.zeros((2, len(RATIOS)))
        predictions = []
        for index, group in enumerate(groups):
            scales = sorted(group.ssims, reverse=True)
            enough = [scale for scale in scales if group.rays * scale**2 >= LEAST_SAMPLES] or scales[:1]
            ssims = np.array([group.ssims[scale] for scale in enough])
            detail = np.array([np.log1p(group.moves * scale / lenses).mean() for scale in enough])
            noise = (group.rays * np.square(enough, dtype=float)) ** -power
            losses = RATIOS[:, None] * detail + noise
            lost[:, index] = max(group.ssims.values()) - ssims[losses.argmin(1)]
            # Only differences between scales count: how accurate a scene is at all is not known. One sample is worse
            # than any power of the samples says; with it the numbers would not be losses in SSIM at others.
            usual = [place for place, scale in enumerate(enough) if group.rays * scale**2 >= 2]
            losses, wanted = losses[:, usual], ssims[usual]
            losses, wanted = losses - losses.mean(1, keepdims=True), wanted.mean() - wanted
            products, squares = products + losses @ wanted, squares + np.square(losses).sum(1)
            predictions.append((losses, wanted))
        factors = np.maximum(products, 1e-9) / np.maximum(squares, 1e-9)
        for index, (losses, wanted) in enumerate(predictions):
            errors[:, index] = np.square(factors[:, None] * losses - wanted).mean(1)
        yield lost, errors, np.stack([factors * RATIOS, np.full(len(RATIOS), lenses), factors,
                                      np.full(len(RATIOS), power)], 1)
