"""Names of quilts, ``name_qs8x6a0.75.png``, and the quilts that other programs know.

pylightio, which AliceLG reads quilts with, knows them by their sizes and takes the numbers in a name for rows and
columns in the other order; a quilt of another size can be taken for one with rows and columns exchanged.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from lfsr_core.base.errors import LfsrError, did_you_mean

Pair = tuple[int, int]
SUFFIX = re.compile(r"_qs(\d{1,4})x(\d{1,4})(?:a(\d{1,4}(?:\.\d{1,9})?))?(?![\dx])", re.IGNORECASE)


class Preset(NamedTuple):
    """A quilt that other programs know; pairs are (across, down)."""

    panel: Pair  # pixels of the panels that it is for
    grid: Pair  # tiles
    tile: Pair  # pixels


PRESETS = {
    "portrait": Preset((1536, 2048), (8, 6), (420, 560)),
    "8.9": Preset((2560, 1600), (5, 9), (819, 455)),
    "16": Preset((3840, 2160), (7, 7), (857, 857)),
    "16-portrait": Preset((2160, 3840), (11, 6), (545, 1000)),
    "go": Preset((1440, 2560), (11, 6), (372, 682)),
    "32-portrait": Preset((4320, 7680), (11, 6), (744, 1364)),
    "65": Preset((7680, 4320), (8, 9), (1024, 910)),
}


def find_preset(name: str) -> Preset:
    """The quilt of this name; LfsrError for an unknown one."""
    if name not in PRESETS:
        raise LfsrError(f"preset is {name!r}: {did_you_mean(name, PRESETS)}Choose from {', '.join(PRESETS)}")
    return PRESETS[name]


def usual_preset(panel: Pair) -> Preset | None:
    """The quilt for a panel of so many pixels; None where programs know none."""
    return next((preset for preset in PRESETS.values() if preset.panel == panel), None)


def quilt_name(name: str, grid: Pair, aspect: float) -> str:
    """Name of a quilt's file without its ending; ``aspect``: the panel's width / height."""
    return f"{name}_qs{grid[0]}x{grid[1]}a{aspect:.4g}"


class QuiltShape(NamedTuple):
    """What a quilt's name says."""

    grid: Pair  # tiles (across, down)
    aspect: float | None  # width / height of the panel that it was made for; None: not said


def read_quilt_name(name: str) -> QuiltShape | None:
    """What a file's name says of a quilt; None where it names no tiles."""
    found = SUFFIX.search(name)
    if not found:
        return None
    across, down, aspect = found.groups()
    return QuiltShape((int(across), int(down)), float(aspect) if aspect and float(aspect) else None)


def without_suffix(name: str) -> str:
    """A quilt's name without its tiles and aspect ratio."""
    return SUFFIX.sub("", name)


def usual_aspect(grid: Pair) -> float | None:
    """Aspect ratio of the panel whose quilts have this grid; None where programs know none."""
    known = [preset.panel for preset in PRESETS.values() if preset.grid == grid]
    return known[-1][0] / known[-1][1] if known else None
