"""What the paper's figures keep as JSON: how accurate methods are, and how long things take."""

from __future__ import annotations

import dataclasses

from lfsr_lab.experiments.engine.accuracy import Figures
from lfsr_lab.experiments.engine.timing import Seconds


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
    """How near a method comes to the reference on one scene, and how long a frame takes."""

    scene: str = ""  # its name
    method: str = ""  # its name, or that of the row
    how: str = ""  # scale, samples and method
    samples: int | None = None  # per pixel of the render
    metrics: Figures | None = None  # None without weights
    ci95: Figures = dataclasses.field(default_factory=dict)  # half-widths, where lenses were sampled
    error: SplitError | None = None  # None without foreground
    lens_ssim_fg: tuple[float, ...] = ()  # split SSIM of every foreground lens on its own
    # epi, epi_border: split squared errors of display values, means over the foreground lenses of each lens row, of all
    # views and of the outermost ones on either side, where a neighbour's light would show
    epi: tuple[float, ...] = ()
    epi_border: tuple[float, ...] = ()
    picture: str | None = None  # file name of what is shown of it
    reason: str | None = None  # why nothing could be measured, None where weights were the reason
    render: float = 0.0  # seconds of the first stage, timed once
    second_stage: float = 0.0  # seconds, median of repeated runs

    @property
    def is_measured(self) -> bool:
        """True if the row has figures."""
        return bool(self.metrics or self.epi)

    def value(self, name: str) -> float:
        """Return a metric that is known."""
        return (self.metrics or {}).get(name) or 0.0

    @property
    def total(self) -> float:
        """Seconds per frame."""
        return self.render + self.second_stage


@dataclasses.dataclass(frozen=True, kw_only=True)
class Rows(Results):
    """Rows of every scene and method of a figure."""

    rows: tuple[Row, ...]
    samples: tuple[int, ...] = ()  # per pixel, from few to many

    def at(self, samples: int) -> list[Row]:
        """Return the rows of one number of samples."""
        return [row for row in self.rows if row.samples == samples]


@dataclasses.dataclass(frozen=True, kw_only=True)
class NetworkTimes:
    """Networks on elemental images of random pixels, nothing else."""

    seconds: Seconds  # by the network's name or the step
    engine: str  # "cuda" or "torch"
    device: str  # its name
    threads: int = 0  # of PyTorch
