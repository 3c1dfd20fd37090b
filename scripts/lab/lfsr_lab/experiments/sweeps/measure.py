"""The cells of the parameter sweeps: every method at every value, each with its scene, reference and render."""

from __future__ import annotations

import dataclasses
import functools
import importlib.util
from collections.abc import Iterator, Sequence
from pathlib import Path

from lfsr_core.base.arrays import Array
from lfsr_core.frames.frame import Request, Sampling
from lfsr_core.images.color import srgb_encode
from lfsr_core.reconstruct.methods import DEFAULT_METHOD
from lfsr_core.reconstruct.second_stage import finished_linear
from lfsr_core.reconstruct.upscaler import recall
from lfsr_lab.experiments.engine import records
from lfsr_lab.experiments.engine.truth import Metrics, Truth, finite
from lfsr_lab.experiments.sweeps import metrics
from lfsr_lab.experiments.sweeps.records import EYE, MOTION, Cell, Settings, Sweep
from lfsr_lab.networks.comparators import NETWORKS
from lfsr_lab.networks.methods import COMPARED, LabMethod, ready
from lfsr_lab.scenes.sweeps.space import Space, card_centre, card_of_motion

DISPLAY_FILE = Path(__file__).parent / "sweeps.toml"
BASELINE, CELLS = "bicubic", "cells"


def default_methods(scale: int, parallax: tuple[bool, bool] = (True, True)) -> list[str]:
    """Return bicubic, what the default is compared with, the default, and the networks that the display can have."""
    names = [BASELINE, *COMPARED, DEFAULT_METHOD]
    if importlib.util.find_spec("torch"):
        names += [name for name, network in NETWORKS.items() if scale in network.weights]
    return [name for name in names if LabMethod.parse(name).works_with(parallax)]


def finished(render: Path, name: str) -> Array:
    """Return what a method, which may have a network, makes of a render, (H, W, 3), scene-linear."""
    finish, upscaler = ready(name)
    return finished_linear(render, finish, upscaler=upscaler)


@dataclasses.dataclass(frozen=True)
class Scene:
    store: records.Store
    settings: Settings
    sweep: Sweep
    value: float
    seed: int = 0  # of the noise of its renders

    @property
    def folder(self) -> Path:
        return self.store.folder / self.sweep.scene_name(self.value)

    def cells(self, methods: Sequence[str]) -> Iterator[Cell]:
        """Yield the cell of every method; what is missing is rendered and measured now."""
        samples = self.sweep.samples(self.value)
        end = f"-seed{self.seed}" if self.seed else ""
        wanted = [records.Cell(f"{name}-{self.sweep.name}-spp{samples}{end}", records.method_facts(name),
                             functools.partial(self.measure, name), self.jobs) for name in methods]
        yield from records.measured(wanted, records.Records(self.folder / CELLS, Cell), self.store)

    @property
    def jobs(self) -> list[Request]:
        """Everything that its cells need: of motion a render per frame and kind of seed."""
        moving = range(1, self.settings.frames + 1) if self.sweep.name == MOTION else ()
        jobs = [self.reference_job, self.job(), *(self.job(frame, seed) for frame in moving for seed in (0, frame))]
        return list({job.output: job for job in jobs}.values())

    @property
    def reference_job(self) -> Request:
        return records.reference_of(self.job(), self.settings.reference_samples, self.folder / records.REFERENCE)

    def job(self, frame: int = 1, seed: int | None = None) -> Request:
        """Return a low-resolution render: of a frame other than 1 only of the moving card; ``seed`` of its noise."""
        settings, folder, seed = self.settings, self.folder, self.seed if seed is None else seed
        samples = self.sweep.samples(self.value)
        suffix = "" if (frame, seed) == (1, 0) else f"-frame{frame}-seed{seed}"
        return Request(output=str(folder / f"s{settings.scale}-spp{samples}{suffix}"), display=settings.display,
                   scene=str((folder / records.SCENE_FILE).resolve()), sampling=Sampling(settings.scale, samples),
                   seed=seed, frame=frame, device=settings.device)

    @functools.cached_property
    def truth(self) -> Truth:
        return Truth(Path(self.reference_job.output))

    @property
    def space(self) -> Space:
        return Space.of(self.settings.display, self.settings.scale)

    def measure(self, name: str) -> Cell:
        truth, image = self.truth, finished(Path(self.job().output), name)
        half_a, half_b = map(srgb_encode, truth.whole)
        of = metrics.Compared(srgb_encode(image), half_a, half_b, self.settings.display.lenses, truth.mask)
        if self.seed:
            values = self._judged(of)
        else:
            values = self.truth.metrics(image, records.foreground(Path(self.job().output)))
            values |= metrics.border_and_centre(of, width=self.settings.scale)
            values["neighbour_error"] = metrics.neighbour_view_error(of)
            values |= self._straightness(of) if self.sweep.name == EYE else {}
            values |= self._flicker(name) if self.sweep.name == MOTION else {}
        figures = {key: finite(value) for key, value in values.items()}
        return Cell(self.value, self.sweep.scene_name(self.value), self.sweep.samples(self.value), name, figures,
                    metrics.worst_lens(of), **records.method_facts(name))

    def _judged(self, of: metrics.Compared) -> Metrics:
        """Return the figure by which the sweep is judged, and what costs nothing beside it."""
        if self.sweep.name == EYE:
            return self._straightness(of)
        if self.sweep.judged == "recall":
            return {"recall": recall(records.foreground(Path(self.job().output)), of.mask)}
        if self.sweep.judged == "ssim_border":
            return metrics.border_and_centre(of, width=self.settings.scale)
        return {"ssim_eia_fg": metrics.foreground_ssim(of)}

    def _straightness(self, of: metrics.Compared) -> Metrics:
        step = self.space.scale / self.value
        names = ("epi_straightness", "epi_straightness_reference")
        if not step.is_integer():  # no two views that see the same points
            return dict.fromkeys(names)
        # A point does not move by whole rows where they are not as high as columns are wide.
        axes = (0, 1) if self.space.row == 1 and self.space.views[1] > 1 else (1,)
        return {name: metrics.epi_straightness(image, of.lenses, int(step), other, axes)
                for name, (image, other) in zip(names, ((of.x, None), (of.a, of.b)), strict=True)}

    def _flicker(self, name: str) -> Metrics:
        """Return the flicker with one seed for all frames and with a seed for each."""
        count = self.settings.frames
        y, half, path = card_of_motion(self.space, int(self.value), count)
        cards = [metrics.card_pixels(self.space, y, card_centre(self.space, y, place, path), half) for place in path]
        flickers: Metrics = {}
        for kind, changes in (("fixed", False), ("changing", True)):
            folders = [Path(self.job(frame, frame if changes else 0).output) for frame in range(1, count + 1)]
            images = [srgb_encode(finished(folder, name)) for folder in folders]
            flickers[f"flicker_{kind}"] = metrics.flicker(images, self.settings.display.lenses, path, cards)
        measured = [value for value in flickers.values() if value is not None]
        return flickers | {"steadiness": 1 - max(measured) if measured else None}
