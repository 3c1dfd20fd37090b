"""What the fit reads: depths of scenes, and accuracies at several scales with equal rays."""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from lfsr_core.base.files import read_json, write_json
from lfsr_core.optics.depth_scale import scales_up_to
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.pipeline.store import is_complete
from lfsr_core.process.blender import find_blender
from lfsr_lab.experiments.denoiser.__main__ import measured
from lfsr_lab.experiments.denoiser.measure import Candidate
from lfsr_lab.experiments.denoiser.settings import Place, Settings, places
from lfsr_lab.experiments.engine.renders import REFERENCE, Store, scene_script
from lfsr_lab.scenes.running import run_script

QUANTILES = 64  # of a scene's disparities that are stored


@dataclasses.dataclass(frozen=True)
class Cell:
    """Accuracy of a scene at one scale."""

    scene: str
    group: str
    rays: float  # per finished pixel, the same for all scales that are compared
    scale: int
    ssim: float  # mean `ssim_lens_fg`


@dataclasses.dataclass(frozen=True)
class Table:
    """Everything measured with one method."""

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
        if all(place.scene.profile.parallax) and is_complete(place.folder / REFERENCE, "reference"):
            found = _cells(place, settings, candidate)
            if found:
                cells += found
                moves[place.scene.name] = _moves(place.file, place.scene.profile, store.blender)
    return Table(candidate.label, moves, tuple(cells))


def _cells(place: Place, settings: Settings, candidate: Candidate) -> list[Cell]:
    """Return the accuracies of a scene at the scales that may be chosen, where at least two have renders."""
    name, group, cells = place.scene.name, place.scene.group, []
    allowed = scales_up_to(place.scene.profile)
    for every in settings.at_rays(place.scene).values():
        renders = [render for render in every if render.scale in allowed]
        figures = measured(place, renders, [candidate])
        rays = max((render.samples / render.scale**2 for render in renders), default=0.0)
        found = [Cell(name, group, rays, render.scale, float(np.mean(figures[name, render, candidate.label].ssim)))
                 for render in renders if (name, render, candidate.label) in figures]
        cells += found if len(found) > 1 else []
    return cells


def _moves(scene: Path, display: DisplayProfile, blender: str | None) -> tuple[float, ...]:
    """Return the quantiles of a scene's disparities."""
    with tempfile.TemporaryDirectory(prefix="lfsr-scales-") as folder:
        job, output = Path(folder, "job.json"), Path(folder, "moves.json")
        write_json(job, {"scene": str(scene.resolve()), "display": display.to_dict(), "output": str(output)})
        run_script(find_blender(blender), scene_script("seen_depths.py"), job, [output])
        moves = read_json(output, "disparities")
    return tuple(float(f"{value:.5g}") for value in np.quantile(moves, (np.arange(QUANTILES) + 0.5) / QUANTILES))
