"""Accuracy of a method in the lenses that a reference shows, lens by lens, so that methods can be compared in pairs.

Errors are those of engine.measures, of one render each.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.frame import Frame
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.reconstruct.methods import MethodName
from lfsr_lab.experiments.engine.measures import FLIP, RELMSE, SSIM, VERSION, errors
from lfsr_lab.experiments.engine.records import Fingerprint, method_facts
from lfsr_lab.experiments.engine.renders import digest, frame_digest
from lfsr_lab.experiments.engine.timing import cpu_seconds
from lfsr_lab.experiments.engine.truth import Truth

METRICS = {"ssim": "`ssim_lens_fg`", "flip": "HDR-FLIP", "relative": "relMSE"}


@dataclasses.dataclass(frozen=True)
class Figures:
    """Of one render and method: one value per foreground lens, or per view where views differ along one axis."""

    ssim: tuple[float, ...]  # split SSIM
    flip: tuple[float, ...]  # HDR-FLIP against the mean of the halves
    relative: tuple[float, ...]  # relMSE
    squared: tuple[float, ...]  # squared error of display values, split
    cpu_seconds: float  # of all prefilters, and of finishing the reference's lenses


@dataclasses.dataclass(frozen=True)
class Candidate:
    """A method, with a file of weights where it is to have others than the shipped ones."""

    name: MethodName
    weights: Path | None = None

    @classmethod
    def parse(cls, text: str) -> Candidate:
        """Parse METHOD or METHOD=WEIGHTS."""
        name, _, weights = text.partition("=")
        return cls(MethodName.parse(name), Path(weights).resolve() if weights else None)

    @property
    def label(self) -> str:
        """Its name in tables and files."""
        return self.name.text + (f"={self.weights.parent.name}-{self.weights.stem}" if self.weights else "")

    def at(self, frame: Frame) -> Candidate | None:
        """Return it as it finishes a frame; None where it cannot."""
        if frame.scale == 1:
            return dataclasses.replace(self, name=self.name.at_scale(1))
        return self if self.name.works_at(frame.scale) else None

    def facts(self, render: Path, reference: Path) -> Fingerprint:
        """Return what its figures depend on."""
        weights = {"file": digest(self.weights.read_bytes())} if self.weights else {}
        return {"version": VERSION, "render": frame_digest(render), "reference": frame_digest(reference),
                "method": self.name.text, **method_facts(self.name.text), **weights}


def measure(render: Path, truth: Truth, candidate: Candidate) -> Figures:
    """Finish the reference's lenses and compare them with it."""
    finish = Finish(candidate.name.text, weights=str(candidate.weights) if candidate.weights else None)
    started = cpu_seconds()
    images = truth.finished(render, finish)
    return figures(truth, images, cpu_seconds() - started)


def figures(truth: Truth, images: Array, seconds: float) -> Figures:
    """Return the figures of scene-linear images as ``Truth.shown``."""
    found = errors(images[None], *truth.halves)
    x, a, b = (srgb_encode(values) for values in (images, *truth.halves))
    return Figures(_values(1 - found[SSIM][0]), _values(found[FLIP][0]), _values(found[RELMSE][0]),
                   _values(((x - a) * (x - b)).mean((1, 2, 3), dtype=np.float64)), round(seconds, 3))


def _values(values: Any) -> tuple[float, ...]:
    return tuple(float(f"{value:.6g}") for value in values)
