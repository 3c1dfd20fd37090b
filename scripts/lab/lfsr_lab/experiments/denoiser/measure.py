"""Accuracy of a method in the lenses that a reference shows, lens by lens, so that methods can be compared in pairs.

The relative squared error is the mean of (x - a)(x - b) / (m² + RELATIVE), scene-linear: a and b are the halves of the
reference, whose noise cancels, m the mean of both halves and of a pixel's channels. HDR-FLIP is taken against the mean
of both halves.
"""

from __future__ import annotations

import dataclasses
from functools import cached_property
from pathlib import Path
from typing import Any

import flip_evaluator
import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.frames.foreground import foreground_mask
from lfsr_core.frames.frame import LOW_RES_FILE, Frame, read_frame
from lfsr_core.frames.low_res import low_resolution, read_world
from lfsr_core.frames.reference import Reference
from lfsr_core.images.exr import clean, read_layers
from lfsr_core.images.srgb import srgb_encode
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.reconstruct.registry import method
from lfsr_core.reconstruct.second_stage import finished_lenses
from lfsr_lab.experiments.engine.accuracy import lens_ssims
from lfsr_lab.experiments.engine.records import Fingerprint, method_facts
from lfsr_lab.experiments.engine.renders import digest, frame_digest
from lfsr_lab.experiments.engine.timing import cpu_seconds

VERSION = 2  # of how figures are measured
# In stops. HDR-FLIP's own choice depends on the median, which is black where much of the background is seen.
EXPOSURES = {"startExposure": -2.0, "stopExposure": 2.0, "numExposures": 5}
RELATIVE = 0.01
METRICS = {"ssim": "`ssim_lens_fg`", "flip": "HDR-FLIP", "relative": "relMSE"}


@dataclasses.dataclass(frozen=True)
class Figures:
    """Of one render and method: one value per foreground lens, or per view where views differ along one axis."""

    ssim: tuple[float, ...]  # split SSIM
    flip: tuple[float, ...]  # HDR-FLIP against the mean of the halves
    relative: tuple[float, ...]  # relative squared error, split
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
        if not self.name.works_with(frame.display.parallax):
            return None
        if frame.scale == 1:
            return dataclasses.replace(self, name=self.name.at_scale(1))
        return self if self.name.works_at(frame.scale) else None

    def facts(self, render: Path, reference: Path) -> Fingerprint:
        """Return what its figures depend on."""
        weights = {"file": digest(self.weights.read_bytes())} if self.weights else {}
        return {"version": VERSION, "render": frame_digest(render), "reference": frame_digest(reference),
                "method": self.name.text, **method_facts(self.name.text), **weights}


@dataclasses.dataclass(frozen=True)
class Truth:
    """What images are compared with."""

    folder: Path

    @cached_property
    def reference(self) -> Reference:
        """The reference, read when first asked for."""
        return Reference.read(self.folder)

    @cached_property
    def counted(self) -> Array:
        """(n,) bool: the reference's lenses that count; all of the block where views differ along one axis."""
        one_axis = not all(self.reference.frame.display.parallax)
        return self.reference.foreground | one_axis

    @cached_property
    def lenses(self) -> Array:
        """(n, 2) rows and columns of the lenses that count."""
        return self.reference.lenses[self.counted]

    @cached_property
    def halves(self) -> tuple[Array, Array]:
        """Both halves, scene-linear, as ``shown``."""
        a, b = (self.shown(images[self.counted]) for images in self.reference.linear_images())
        return a, b

    def shown(self, images: Array) -> Array:
        """Return elemental images (n, py, px, 3) as they are compared; decoded views of a block of lenses."""
        if all(self.reference.frame.display.parallax):
            return images
        rows = len(np.unique(self.lenses[:, 0]))
        block = images.reshape(rows, -1, images.shape[1] * images.shape[2], 3)
        return np.ascontiguousarray(np.moveaxis(block, 2, 0))

    def figures(self, finished: Array, seconds: float) -> Figures:
        """Return the figures of scene-linear elemental images of ``lenses``."""
        images, (a, b) = self.shown(finished), self.halves
        mean = (a + b) / 2
        relative = (images - a) * (images - b) / (mean.mean(-1, keepdims=True)**2 + RELATIVE)
        shown = [srgb_encode(values) for values in (images, a, b)]
        flips = [_flip(*pair) for pair in zip(mean, images, strict=True)]
        return Figures(_values(lens_ssims(*shown)), _values(flips), _lenses(relative),
                       _lenses((shown[0] - shown[1]) * (shown[0] - shown[2])), round(seconds, 3))


def measure(render: Path, truth: Truth, candidate: Candidate) -> Figures:
    """Finish the reference's lenses and compare them with it."""
    layers, frame = clean(read_layers(render / LOW_RES_FILE))[0], read_frame(render)
    low = low_resolution(layers, frame, read_world(render, frame))
    rows, columns = truth.lenses.T
    mask, ready = foreground_mask(layers, frame.rays.tiles)[rows, columns], method(candidate.name, candidate.weights)
    started = cpu_seconds()
    images = finished_lenses(low, mask, ready, truth.lenses)
    return truth.figures(images, cpu_seconds() - started)


def _flip(reference: Array, image: Array) -> float:
    images = [np.ascontiguousarray(values, np.float32) for values in (reference, image)]
    return float(flip_evaluator.evaluate(*images, "HDR", inputsRGB=False, applyMagma=False,
                                         parameters=dict(EXPOSURES))[1])


def _lenses(values: Array) -> tuple[float, ...]:
    return _values(values.mean((1, 2, 3), dtype=np.float64))


def _values(values: Any) -> tuple[float, ...]:
    return tuple(float(f"{value:.6g}") for value in values)
