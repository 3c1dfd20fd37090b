"""How far a whole chart is, and how long it still takes, from what each of its steps costs about."""

from __future__ import annotations

import math
import time
from collections.abc import Hashable, Iterator, Mapping, Sequence
from pathlib import Path

from lfsr_core.progress import ProgressBar
from lfsr_core.render.store import is_complete
from lfsr_lab.experiments.chart.settings import CELL_FOLDER, DIRECT_METHODS, Settings, render_folder
from lfsr_lab.experiments.engine.renders import REFERENCE

CELL_SAMPLES = 8  # a cell takes about as long as so many samples of every pixel at full resolution
STAGE, LEAST_FRACTION, LEAST_SECONDS = "chart", 0.01, 5.0  # below them time left is a guess
Costs = Mapping[Hashable, float]


class Overall:
    """A progress bar of all steps; each render's own progress counts as far as the render does."""

    def __init__(self, costs: Costs, bar: ProgressBar | None = None) -> None:
        """``costs`` by step, in any unit; steps that are not among them cost nothing."""
        self._costs, self._total = costs, sum(costs.values())
        self._bar, self._started = bar or ProgressBar(), time.monotonic()
        self._done, self._step, self._within, self._sentence = 0.0, 0.0, 0.0, ""

    @property
    def fraction(self) -> float:
        """Share of the work that is done, 0 to 1."""
        return min((self._done + self._step * self._within) / self._total, 1.0) if self._total else 1.0

    @property
    def left(self) -> str:
        """Time left in words, empty while that would be a guess."""
        seconds, fraction = time.monotonic() - self._started, self.fraction
        if seconds < LEAST_SECONDS or fraction < LEAST_FRACTION:
            return ""
        return f"{clock(seconds * (1 - fraction) / fraction)} left, "

    def begin(self, step: Hashable, sentence: str) -> None:
        """A step begins, and the one before is done."""
        self._done += self._step
        self._step, self._within, self._sentence = self._costs.get(step, 0.0), 0.0, sentence
        self._bar(STAGE, self.fraction, f"{self.left}{sentence}")

    def __call__(self, stage: str, fraction: float, message: str) -> None:
        """Progress of the step that runs, as ``run_job`` tells it."""
        self._within = max(self._within, min(fraction, 1.0))
        self._bar(STAGE, self.fraction, f"{self.left}{self._sentence}: {message}")

    def note(self, message: str) -> None:
        """A line that stays."""
        self._bar.note(message)

    def close(self) -> None:
        """The step that runs is done; the bar goes on."""
        self._within = 1.0

    def end(self) -> None:
        """Nothing follows."""
        self._bar.close()


def clock(seconds: float) -> str:
    """Seconds as "0:42" or "1:05:09"."""
    hours, rest = divmod(math.ceil(seconds), 3600)
    return f"{hours}:{rest // 60:02d}:{rest % 60:02d}" if hours else f"{rest // 60}:{rest % 60:02d}"


def costs(settings: Settings, scenes: Sequence[Path]) -> dict[Hashable, float]:
    """About what every step costs that is not done yet, in path samples."""
    return {step: cost for scene in scenes for step, cost in _of_scene(settings, settings.folder / scene.stem)}


def _of_scene(settings: Settings, folder: Path) -> Iterator[tuple[Hashable, float]]:
    display, reference = settings.profile, folder / REFERENCE
    pixels = math.prod(display.lenses) * math.prod(display.views)
    if not (is_complete(reference, "reference") or settings.only_measure):
        share = 1.0 if settings.lenses is None else settings.lenses / math.prod(display.lenses)
        yield reference, pixels * share * settings.reference_spp
    wanted = [(settings.scale, samples) for samples in (*settings.spps, *filter(None, [settings.ceiling_spp]))]
    for scale, samples in [*wanted, *((1, samples) for samples in settings.direct_spps)]:
        render = render_folder(folder, scale, samples, settings.seed)
        if not (is_complete(render) or settings.only_measure):
            yield render, pixels / scale**2 * samples
        for name in DIRECT_METHODS if scale == 1 else settings.methods:
            known = (folder / CELL_FOLDER / f"{render.name}-{name}.json").exists()
            if not known or name in settings.again or name in settings.retime:
                yield (render, name), pixels * CELL_SAMPLES
