"""What the paper's figures keep as JSON: how accurate methods are, and how long things take."""

from __future__ import annotations

import dataclasses
from typing import Any

Seconds = dict[str, tuple[float, ...]]
"""Seconds of every run, by the name of what was run."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Results:
    """What every figure has, beside its own measurements.

    Attributes
    ----------
    load: highest load average seen after any measurement, None where the system tells none.
    schedules: how the network of each method was trained, in one phrase.
    """

    load: float | None = None
    schedules: dict[str, str] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class SplitError:
    """Squared error of foreground lenses, noise of the reference cancelled, in two parts that add up.

    Attributes
    ----------
    border: of the outermost views of elemental images.
    centre: of the other views.
    border_pixels: share of the pixels that are outermost.
    """

    border: float
    centre: float
    border_pixels: float


@dataclasses.dataclass(frozen=True, kw_only=True)
class Accuracy:
    """How near a method comes to the reference; of a network without weights nothing is known.

    Attributes
    ----------
    metrics: figures by name, None where one could not be computed; None altogether without weights.
    ci95: half-widths of the metrics' 95 % intervals, where lenses were sampled.
    error: where the error lies, None without foreground.
    lens_ssim_fg: split SSIM of every foreground lens, the same lenses for every method.
    picture: file name of what is shown of it.
    """

    metrics: dict[str, float | None] | None = None
    ci95: dict[str, float | None] = dataclasses.field(default_factory=dict)
    error: SplitError | None = None
    lens_ssim_fg: tuple[float, ...] = ()
    picture: str | None = None


@dataclasses.dataclass(frozen=True, kw_only=True)
class FrameTimes:
    """Seconds of one frame.

    Attributes
    ----------
    render: of the first stage, timed once.
    second_stage: median of repeated runs.
    """

    render: float
    second_stage: float

    @property
    def total(self) -> float:
        """Seconds per frame."""
        return self.render + self.second_stage


@dataclasses.dataclass(frozen=True, kw_only=True)
class Row(Accuracy):
    """Accuracy of one method on one scene.

    Attributes
    ----------
    scene: its name.
    method: its name.
    samples: per pixel of the render, where a figure has several.
    """

    scene: str
    method: str
    samples: int | None = None

    @classmethod
    def of(cls, measured: Any, **keys: Any) -> Any:
        """A row of a kept measurement, None where there is none, under its ``keys``."""
        return cls(**(vars(measured) if measured else {}), **keys)


@dataclasses.dataclass(frozen=True, kw_only=True)
class NetworkTimes:
    """Networks on elemental images of random pixels, nothing else.

    Attributes
    ----------
    seconds: of every run, by the network's name or the step.
    engine: "cuda" or "torch".
    device: its name.
    threads: of PyTorch.
    """

    seconds: Seconds
    engine: str
    device: str
    threads: int = 0
