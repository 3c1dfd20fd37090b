"""What the paper's figures keep as JSON: how accurate methods are, and how long things take."""

from __future__ import annotations

import dataclasses

Seconds = dict[str, tuple[float, ...]]
"""Seconds of every run, by the name of what was run."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Results:
    """What every figure has beside its own measurements."""

    load: float | None = None  # highest load average seen after any measurement, None where the system tells none
    schedules: dict[str, str] = dataclasses.field(default_factory=dict)  # how each method's network was trained


@dataclasses.dataclass(frozen=True)
class SplitError:
    """Squared error of foreground lenses, noise of the reference cancelled, in two parts that add up."""

    border: float  # of the outermost views of elemental images
    centre: float  # of the other views
    border_pixels: float  # share of the pixels that are outermost


@dataclasses.dataclass(frozen=True, kw_only=True)
class Row:
    """How near a method comes to the reference on one scene."""

    scene: str = ""  # its name
    method: str = ""  # its name, or that of the row
    samples: int | None = None  # per pixel of the render
    metrics: dict[str, float | None] | None = None  # None where one cannot be computed; altogether without weights
    ci95: dict[str, float | None] = dataclasses.field(default_factory=dict)  # half-widths, where lenses were sampled
    error: SplitError | None = None  # None without foreground
    lens_ssim_fg: tuple[float, ...] = ()  # split SSIM of every foreground lens on its own
    picture: str | None = None  # file name of what is shown of it


@dataclasses.dataclass(frozen=True, kw_only=True)
class FrameTimes:
    """Seconds of one frame."""

    render: float = 0.0  # of the first stage, timed once
    second_stage: float = 0.0  # median of repeated runs

    @property
    def total(self) -> float:
        """Seconds per frame."""
        return self.render + self.second_stage


@dataclasses.dataclass(frozen=True, kw_only=True)
class NetworkTimes:
    """Networks on elemental images of random pixels, nothing else."""

    seconds: Seconds  # by the network's name or the step
    engine: str  # "cuda" or "torch"
    device: str  # its name
    threads: int = 0  # of PyTorch
