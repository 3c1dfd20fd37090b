"""report.json: how a frame folder was finished, and its metrics."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from lfsr_core.base.notices import Notice
from lfsr_core.base.records import read_record, write_record
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.frame import REPORT_FILE


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
