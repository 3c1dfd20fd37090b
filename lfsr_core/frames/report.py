"""report.json: what the second stage and the comparison say of a frame folder."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from lfsr_core.frames.frame import REPORT_FILE
from lfsr_core.records import read_record, write_record


@dataclasses.dataclass(frozen=True)
class Report:
    """How a frame was finished, see docs/reference/frame-folder.md.

    Attributes
    ----------
    method : name of the method
    display : name of the display
    scale, samples : of the render
    seconds : of each stage
    peak_bytes : most memory that the process held, None where the system does not say
    foreground_share : of the lenses, in [0, 1]
    notes : what the user should know
    metrics : against a reference, empty until it was compared
    replaced_pixels : pixels of the render that were not finite
    dilate : lenses by which the foreground mask was grown
    weights : file that replaced the weights of the method's network, None for the shipped ones
    """

    method: str
    display: str
    scale: int
    samples: int
    seconds: dict[str, float]
    peak_bytes: int | None
    foreground_share: float
    notes: tuple[str, ...] = ()
    metrics: dict[str, Any] = dataclasses.field(default_factory=dict)
    replaced_pixels: int = 0
    dilate: int = 0
    weights: str | None = None


def write_report(folder: str | Path, report: Report) -> None:
    """Write ``report.json`` into ``folder``."""
    write_record(Path(folder) / REPORT_FILE, report)


def read_report(folder: str | Path) -> Report:
    """Read ``report.json``; LfsrError if it is absent or damaged."""
    return read_record(Path(folder) / REPORT_FILE, Report, "the report of `lfsr render` or `lfsr upscale`")
