"""Options of the second stage."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from lfsr_core.base.progress import Progress, silent


@dataclasses.dataclass(frozen=True)
class UpscaleOptions:
    """How to finish a frame, besides the method."""

    step: int | None = None  # elemental images per call of the method; None: as many as suit the method
    dilate: int = 0  # lenses by which the foreground mask grows
    selection: bool = True  # False: every lens counts as foreground
    weights: str | Path | None = None  # weights file for the method's network; None: the shipped one
    linear_exr: bool = False  # also write the scene-linear eia.exr
    temporal_averaging: int = 0  # neighbouring frames to each side that are averaged where nothing has changed
    progress: Progress = silent  # called with (stage, fraction, message)


DEFAULT = UpscaleOptions()
