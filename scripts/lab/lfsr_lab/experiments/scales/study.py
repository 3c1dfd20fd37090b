"""Fit the model by which `--scale auto` chooses, and show its choices against the best of the scales at equal rays.

With SCENES, TABLE.json is written first: accuracies on renders that the experiment `denoiser` has made in OUT, and the
depths of its scenes. The numbers belong into lfsr_core/optics/depth_scale.py.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.base.records import read_record, write_record
from lfsr_core.base.system import read_json, write_json
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.frames.frame import scales_up_to
from lfsr_core.optics.depth_scale import LEAST_SAMPLES, MODEL, LossModel, choose_scale
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.process.child import find_blender
from lfsr_lab.experiments.denoiser.study import SETTINGS, Candidate, Settings, measured, places, read_settings
from lfsr_lab.experiments.engine.records import REFERENCE, Store, scene_script
from lfsr_lab.experiments.engine.report import markdown_table
from lfsr_lab.scenes import run_script

QUANTILES = 64  # of a scene's disparities that are stored


@dataclasses.dataclass(frozen=True)
class Cell:
    scene: str
    group: str
    rays: float  # per finished pixel, the same for all scales that are compared
    scale: int
    ssim: float  # mean `ssim_lens_fg`


@dataclasses.dataclass(frozen=True)
class Table:
    method: str
    # quantiles of the lenses by which neighbouring views of the display move what is seen, by scene
    moves: dict[str, tuple[float, ...]]
    cells: tuple[Cell, ...]


def collect(settings: Settings, store: Store, folders: Iterable[Path], method: str) -> Table:
    """Measure ``method`` on the renders of the experiment `denoiser` in ``store``, and look at its scenes' depths.

    Displays with parallax along one axis are left out: there renders of the settings are not of equal rays.
    """
    moves, cells, candidate = {}, list[Cell](), Candidate.parse(method)
    for place in places(store, settings, folders):
        name, profile = place.scene.name, place.scene.profile
        if not all(profile.parallax) or not FrameFolder(place.folder / REFERENCE).holds("reference"):
            continue
        allowed, before = scales_up_to(profile), len(cells)
        for every in settings.at_rays(place.scene).values():  # of the scales that may be chosen, where two have renders
            renders = [render for render in every if render.scale in allowed]
            figures = measured(place, renders, [candidate])
            rays = max((render.samples / render.scale**2 for render in renders), default=0.0)
            compared = [Cell(name, place.scene.group, rays, render.scale, float(np.mean(figures[key].ssim)))
                        for render in renders if (key := (name, render, candidate.label)) in figures]
            cells += compared if len(compared) > 1 else []
        if len(cells) > before:
            moves[name] = _moves(place.file, profile, store.blender)
    return Table(candidate.label, moves, tuple(cells))


def _moves(scene: Path, display: DisplayProfile, blender: str | None) -> tuple[float, ...]:
    """Return the quantiles of a scene's disparities."""
    with tempfile.TemporaryDirectory(prefix="lfsr-scales-") as folder:
        job, output = Path(folder, "job.json"), Path(folder, "moves.json")
        write_json(job, {"scene": str(scene.resolve()), "display": display.to_dict(), "output": str(output)})
        run_script(find_blender(blender), scene_script("seen_depths.py"), job, [output])
        moves = read_json(output, "disparities")
    return tuple(float(f"{value:.5g}") for value in np.quantile(moves, (np.arange(QUANTILES) + 0.5) / QUANTILES))


ENOUGH = 0.005  # loss that a choice may have
TOO_MUCH = 4.0  # times a loss beyond that counts
RATIOS, LENSES, POWERS = np.geomspace(0.5, 50, 41), np.geomspace(0.25, 16, 25), np.linspace(0.3, 1.5, 25)
DISPLAY = load_display("small")  # full parallax: all that the choice asks for


@dataclasses.dataclass(frozen=True)
class Group:
    scene: str
    rays: float
    moves: Array  # (n,)
    ssims: dict[int, float]  # by scale

    @property
    def best(self) -> int:
        return max(self.ssims, key=lambda scale: self.ssims[scale])

    def chosen(self, model: LossModel) -> int:
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
    scenes, left_out = np.array([group.scene for group in groups]), dict[tuple[str, float], float]()
    for scene in set(scenes):
        chosen = lost[_best(weighed[:, scenes != scene], errors[:, scenes != scene])]
        left_out |= {(scene, groups[index].rays): float(chosen[index]) for index in np.flatnonzero(scenes == scene)}
    detail, lenses, noise, power = models[_best(weighed, errors)].tolist()
    return Fit(LossModel(detail, lenses, noise, power), left_out)


def _best(weighed: Array, errors: Array) -> int:
    """Return the row with the least mean loss; of nearly equal ones, with the least squared error."""
    means = weighed.mean(1)
    near = means <= means.min() + 1e-6
    return int(np.argmin(np.where(near, errors.mean(1), np.inf)))


def _grid(groups: list[Group]) -> Iterator[tuple[Array, Array, Array]]:
    """Yield, for models of a grid, losses and squared errors (m, groups) and the models' numbers (m, 4)."""
    for lenses in LENSES:  # arrays by power and ratio
        lost, errors = np.empty((2, len(POWERS), len(RATIOS), len(groups)))
        products, squares, predictions = *np.zeros((2, *lost.shape[:2])), list[tuple[Array, Array]]()
        for index, group in enumerate(groups):
            scales = sorted(group.ssims, reverse=True)
            enough = [scale for scale in scales if group.rays * scale**2 >= LEAST_SAMPLES] or scales[:1]
            ssims = np.array([group.ssims[scale] for scale in enough])
            detail = np.array([np.log1p(group.moves * scale / lenses).mean() for scale in enough])
            noise = (group.rays * np.square(enough, dtype=float)) ** -POWERS[:, None, None]
            losses = RATIOS[:, None] * detail + noise
            lost[..., index] = max(group.ssims.values()) - ssims[losses.argmin(-1)]
            # Only differences between scales count: how accurate a scene is at all is not known. One sample is worse
            # than any power of the samples says; with it the numbers would not be losses in SSIM at others.
            usual = [place for place, scale in enumerate(enough) if group.rays * scale**2 >= 2]
            losses, wanted = losses[..., usual], ssims[usual]
            losses, wanted = losses - losses.mean(-1, keepdims=True), wanted.mean() - wanted
            products, squares = products + losses @ wanted, squares + np.square(losses).sum(-1)
            predictions.append((losses, wanted))
        factors = np.maximum(products, 1e-9) / np.maximum(squares, 1e-9)
        for index, (losses, wanted) in enumerate(predictions):
            errors[..., index] = np.square(factors[..., None] * losses - wanted).mean(-1)
        models = np.broadcast_arrays(factors * RATIOS, lenses, factors, POWERS[:, None])
        yield lost.reshape(-1, len(groups)), errors.reshape(-1, len(groups)), np.stack(models, -1).reshape(-1, 4)


NEEDS_OUTPUT = False  # with a table alone


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("table", type=Path, metavar="TABLE.json", help="accuracies and depths")
    add("scenes", type=Path, nargs="*", metavar="SCENES", help="folders with the files of the settings")
    add("-m", "--method", metavar="METHOD[=WEIGHTS]", help="whose accuracies count")
    add("--settings", type=Path, default=SETTINGS, metavar="FILE.toml", help="default: denoiser.toml of the laboratory")


def run(arguments: argparse.Namespace) -> None:
    """Write the table where scenes are given; fit, and print the choices."""
    if arguments.scenes:
        if arguments.output is None or arguments.method is None:
            raise LfsrError("scenes were given without the folder of their renders and a method: add -o OUT -m METHOD")
        store = Store(arguments.output, arguments.blender)
        write_record(arguments.table, collect(read_settings(arguments.settings), store, arguments.scenes,
                                              arguments.method))
    table = read_record(arguments.table, Table, "accuracies and depths of scenes")
    groups = groups_of(table)
    if not groups:
        raise LfsrError(f"{arguments.table} has no scene with two scales at equal rays: render more of them")
    print("\n".join(page(groups, fit(groups), table.method)))


def page(groups: Sequence[Group], fitted: Fit, method: str) -> list[str]:
    rows = [[group.scene, f"{group.rays:g}", *(f"{group.ssims[scale]:.4f}" if scale in group.ssims else "–"
                                               for scale in (1, 2, 4, 5)), group.best, group.chosen(fitted.model),
             f"{group.lost(fitted.model):.4f}", f"{fitted.left_out[group.scene, group.rays]:.4f}",
             f"{group.lost(MODEL):.4f}"] for group in groups]
    return [f"`{method}`. Lost: against the best scale; left out: by a model fitted to all other scenes.", "",
            *markdown_table(["scene", "rays", "scale 1", "scale 2", "scale 4", "scale 5", "best", "chosen", "lost",
                             "left out", "lost by the model in use"], rows, "lr"), "",
            *markdown_table(["model", "mean", "largest", f"above {ENOUGH}"], [
                ["fitted", *_summary(group.lost(fitted.model) for group in groups)],
                ["fitted to other scenes", *_summary(fitted.left_out.values())],
                ["in use", *_summary(group.lost(MODEL) for group in groups)],
                *([f"always {scale}", *_summary(max(group.ssims.values()) - group.ssims[scale] for group in groups
                                                if scale in group.ssims)] for scale in (2, 4, 5))], "lr"), "",
            ("MODEL = LossModel(" + ", ".join(f"{name}={value:.3g}" for name,
                                               value in vars(fitted.model).items()) + ")")]


def _summary(lost: Iterable[float]) -> list[str]:
    values = np.array([*lost])
    return [f"{values.mean():.4f}", f"{values.max():.4f}", f"{(values > ENOUGH).sum()} of {len(values)}"]
