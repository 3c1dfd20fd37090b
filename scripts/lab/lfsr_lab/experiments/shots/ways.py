"""The ways in which frames of an animation can share work, and what one of them measures."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct.method_name import DEFAULT_METHOD, MethodName
from lfsr_core.reconstruct.methods import temporal_averaging
from lfsr_core.reconstruct.neighbours import read_low
from lfsr_core.reconstruct.registry import Method, method
from lfsr_lab.experiments.cells import Cells
from lfsr_lab.experiments.shots.measure import AFTER, Figures, Truth, Window, measure
from lfsr_lab.experiments.shots.renders import CHANGING, FIXED, TURNING, Bench

ONCE, EACH = "once", "each"
FIT_LENSES = 24  # of a reference, that a fit learns from
OWN, TWO, WHOLE = Window(), Window(2, 2), Window(2, 2, whole=True)


@dataclasses.dataclass(frozen=True)
class Way:
    """One way to render and finish an animation."""

    name: str
    seeds: str = CHANGING
    window: Window = OWN
    fitted: str = ""  # ONCE for the shot, EACH frame, or not at all


FIXED_ALONE, ALONE = Way("fixed seeds, every frame alone", FIXED), Way("seeds that change, every frame alone")
SHARED = Way("shared over 5 frames, 5 seeds in turn", TURNING, WHOLE)
WAYS = (
    FIXED_ALONE, ALONE,
    Way("shared, 1 before and 1 after", window=Window(1, 1)),
    Way("shared, 2 before and 2 after", window=TWO), SHARED,
    Way("shared, 2 before", window=Window(2, 0)),
    Way("fixed seeds, shared, 2 before and 2 after", FIXED, TWO),
    Way("all of 2 before and 2 after, no test", window=Window(2, 2, tested=False)),
    Way("finished images shared, 2 before and 2 after", window=Window(2, 2, where=AFTER)),
)
FITS = (Way("fitted once", fitted=ONCE), Way("fitted to each frame", fitted=EACH),
        Way("fitted once, shared, 2 before and 2 after", window=TWO, fitted=ONCE))


@dataclasses.dataclass(frozen=True)
class Shot:
    """An animation whose renders are there, ready to be finished in any way."""

    bench: Bench
    name: str
    truth: Truth
    fit_seconds: float

    @classmethod
    def read(cls, bench: Bench, name: str, fit_seconds: float) -> Shot:
        """With its references in memory."""
        return cls(bench, name, Truth.read(bench.references(name)), fit_seconds)

    @property
    def unseen(self) -> Array:
        """Numbers of the lenses that no fit learns from, see ``train.fit``."""
        return np.random.default_rng(self.bench.settings.seed).permutation(len(self.truth.lenses))[FIT_LENSES:]

    def figures(self, way: Way, spp: int) -> Figures:
        """Of one way at so many samples, measured once."""
        cells = Cells(self.bench.folder / self.name / "cells", Figures)
        name = f"{way.name} spp{spp}".replace(",", "").replace(" ", "-")
        return cells.get(name, self._fingerprint(way), lambda: self._measure(way, spp))

    def _fingerprint(self, way: Way) -> dict[str, object]:
        name = MethodName.parse(DEFAULT_METHOD)
        shared = temporal_averaging.VERSION if way.window.tested and way.window != OWN else 0
        return {"method": name.text, "versions": name.versions, "weights": name.weights_digest, "sharing": shared,
                "fit": self.fit_seconds if way.fitted else 0}

    def _measure(self, way: Way, spp: int) -> Figures:
        folders = self.bench.low(self.name, way.seeds, spp)
        lows: list[LowResEIA] = [read_low(folder) for folder in folders]
        return measure(lows, self.truth, self._methods(way, folders), way.window, self.unseen)

    def _methods(self, way: Way, folders: Sequence[Path]) -> list[Method]:
        if not way.fitted:
            return [method(DEFAULT_METHOD)] * len(folders)
        middle = len(folders) // 2
        chosen = [middle if way.fitted == ONCE else number for number in range(len(folders))]
        return [method(DEFAULT_METHOD, self._weights(folders[number], number)) for number in chosen]

    def _weights(self, folder: Path, number: int) -> Path:
        """Weights fitted to one frame, made once."""
        from lfsr_lab.train.fit import FitOptions, fit

        fits = self.bench.folder / self.name / "fits"
        path = fits / f"{folder.parent.name}-{folder.name}-{self.fit_seconds:g}.safetensors"
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            options = FitOptions(lenses=FIT_LENSES, seconds=self.fit_seconds, seed=self.bench.settings.seed)
            fit(folder, self.bench.references(self.name)[number], path, options)
        return path
