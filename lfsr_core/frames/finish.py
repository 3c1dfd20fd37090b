"""How a frame is finished, the method of the second stage and its options; and report.json, how that went."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Notice
from lfsr_core.base.records import read_record, write_record
from lfsr_core.frames.frame import REPORT_FILE
from lfsr_core.frames.request import MOST_SEED

MOST_DILATE = 65536  # lenses
MOST_AVERAGED = 8  # frames to each side


@dataclasses.dataclass(frozen=True)
class Finish:
    """The only record of a method and its options; LfsrError on values that no frame can be finished with."""

    method: str  # its name, such as "denoise+pool", see ``reconstruct.methods``
    dilate: int = 0  # lenses by which the foreground mask grows
    weights: str | None = None  # file for the method's network, None for the shipped one
    linear_exr: bool = False  # also write the scene-linear eia.exr
    temporal_averaging: int = 0  # neighbouring frames to each side that are averaged where nothing has changed

    def __post_init__(self) -> None:
        if not 0 <= self.dilate <= MOST_DILATE:
            raise LfsrError(f"dilation of the foreground mask is {str(self.dilate)[:20]}, but it must be 0 to "
                            f"{MOST_DILATE} lenses")
        if not 0 <= self.temporal_averaging <= MOST_AVERAGED:
            raise LfsrError(f"temporal averaging is {str(self.temporal_averaging)[:20]} frames to each side, but it "
                            f"must be 0 to {MOST_AVERAGED}")

    @classmethod
    def of(cls, finish: Finish | str) -> Finish:
        """Return a finish, or that of a method's name with the usual options."""
        return finish if isinstance(finish, Finish) else cls(finish)

    def seed_of(self, seed: int, frame: int) -> int:
        """Return the seed of ``frame`` of an animation whose first seed is ``seed``.

        With temporal averaging neighbouring frames have each of 2 · n + 1 seeds once, so that their mean does not
        flicker where nothing moves; without it all frames have one, so that the noise does not move.
        """
        return (seed + (frame - 1) % (2 * self.temporal_averaging + 1)) % (MOST_SEED + 1)


@dataclasses.dataclass(frozen=True)
class Report:
    """How a frame was finished, see docs/reference/frame-folder.md."""

    finish: Finish  # as it was asked for
    method: str  # what ran of its method at this scale
    display: str  # name of the display
    # scale, samples: of the render
    scale: int
    samples: int
    seconds: dict[str, float]  # of each stage
    peak_bytes: int | None  # most memory that the process held, None where the system does not say
    # of the lenses, or of a panel's subpixels, in [0, 1]
    foreground_fraction: float
    notes: tuple[Notice, ...] = ()  # what the user should know
    # against a reference, empty until they are measured
    metrics: dict[str, Any] = dataclasses.field(default_factory=dict)
    replaced_pixels: int = 0  # pixels of the render that were not finite
    # layout, device: what sent the rays, and what Cycles rendered on
    layout: str = ""
    device: str = ""
    neighbours: tuple[int, ...] = ()  # numbers of the frames it was averaged with, and those that could not be
    averaged: float | None = None  # mean weight of the neighbouring frames where this one shows something, in [0, 1]


def write_report(folder: str | Path, report: Report) -> None:
    """Write ``report.json`` into ``folder``."""
    write_record(Path(folder) / REPORT_FILE, report)


def read_report(folder: str | Path) -> Report:
    """Read ``report.json``; LfsrError if it is absent or damaged."""
    return read_record(Path(folder) / REPORT_FILE, Report, "the report of `lfsr render` or `lfsr upscale`")
