"""Export formats by name, their options, and names of quilts, in a module that is quick to import, for menus and
``--help``.

A quilt's name holds columns, rows and the panel's proportions: ``name_qs8x6a0.75.png``. pylightio, which AliceLG reads
quilts with, knows them by their sizes and takes the numbers in a name for rows and columns in the other order; a quilt
of another size can be taken for one with rows and columns exchanged.
"""

import dataclasses
import re
from pathlib import Path
from typing import NamedTuple

from lfsr_core.base.messages import LfsrError, Tell, silent


class Format(NamedTuple):
    """A format of exports, as menus show it."""

    title: str
    text: str  # one line
    options: tuple[str, ...]  # names of the options that it has
    types: tuple[str, ...] = ()  # of files, the first by default, where it has several


QUILT_OPTIONS, EYES = ("views", "grid", "width", "preset"), ("eyes_mm", "width")
FORMATS = {
    "quilt": Format("Quilt", "one image of all views at eye level, for Looking Glass displays", QUILT_OPTIONS),
    "quilt-film": Format("Quilt Film", "the quilts of an animation as a film", (*QUILT_OPTIONS, "type", "fps"),
                         ("mp4", "png")),
    "rgbd": Format("RGB-D", "colour and depth side by side, for Looking Glass displays", ("width",)),
    "stereo": Format("Stereo Pair", "the views of two eyes, side by side", EYES),
    "half-side-by-side": Format("Stereo Half Side by Side", "the views of two eyes at half width, side by side, for 3D "
                                                            "monitors and glasses", EYES),
    "top-bottom": Format("Stereo Top and Bottom", "the views of two eyes, the left one above", EYES),
    "half-top-bottom": Format("Stereo Half Top and Bottom", "the views of two eyes at half height, the left one above",
                              EYES),
    "anaglyph": Format("Anaglyph", "the views of two eyes in red and cyan, for paper glasses", EYES),
    "wiggle": Format("Wiggle", "a short film that changes between two eyes, for people without any display",
                     ("width", "type", "seconds", "fps", "eyes_mm"), ("gif", "webp", "mp4", "png")),
    "sway": Format("Sway Film", "a short film of an eye that sways in front of the display",
                   ("width", "type", "seconds", "fps"), ("mp4", "gif", "webp", "png")),
    "views": Format("Views", "every view as PNG, or as one part of a scene-linear EXR", ("views", "type"),
                    ("png", "exr")),
    "hci": Format("HCI Benchmark", "views, parameters.cfg and disparity as in the HCI 4D light field benchmark",
                  ("views",)),
    "stanford": Format("Stanford Archive", "views named by their places, as in the Stanford light field archive",
                       ("views",)),
    "pleno": Format("JPEG Pleno", "views as PPM, named as in the JPEG Pleno test sets", ("views",))}
FILMS, FILM_RATE = ("sway", "wiggle"), 30.0  # of one frame, and their frames a second
QUILT_FILM = "quilt-film"  # of an animation
H264_SIDE = 6000  # pixels; films of longer sides are HEVC
MOST_VIEWS = 1000  # a side
Pair = tuple[int, int]
SUFFIX = re.compile(r"_qs(\d{1,4})x(\d{1,4})(?:a(\d{1,4}(?:\.\d+)?))?(?![\dx])", re.IGNORECASE)


class Preset(NamedTuple):
    """A quilt that other programs know; pairs are (across, down)."""

    grid: Pair  # tiles
    tile: Pair  # pixels
    aspect: float = 0.0  # width / height of the panel that it is for


# By the model of Looking Glass displays. Sizes that the grid does not divide are rounded down.
PRESETS = {
    "portrait": Preset((8, 6), (420, 560), 3 / 4), "go": Preset((11, 6), (372, 682), 9 / 16),
    "8.9": Preset((5, 9), (819, 455), 8 / 5), "15.6": Preset((5, 9), (819, 455), 16 / 9),
    "16-gen2": Preset((5, 9), (819, 455), 16 / 9), "16": Preset((7, 7), (857, 857), 16 / 9),
    "16-portrait": Preset((11, 6), (545, 1000), 9 / 16), "32-gen2": Preset((5, 9), (1638, 910), 16 / 9),
    "32": Preset((7, 7), (1170, 1170), 16 / 9), "32-portrait": Preset((11, 6), (744, 1364), 9 / 16),
    "65": Preset((8, 9), (1024, 910), 16 / 9)}


@dataclasses.dataclass(frozen=True)
class ExportOptions:
    """Options of an export; None: the default of the format. LfsrError for values out of range."""

    views: tuple[int, int] | None = None  # cameras across and down, evenly spaced over the viewing zone
    grid: tuple[int, int] | None = None  # columns and rows of a quilt
    preset: str | None = None  # of a quilt, one of PRESETS
    eyes_mm: float | None = None  # distance between the eyes of a stereo pair or wiggle
    width: int | None = None  # in pixels, of an image or of a quilt's tile
    type: str | None = None  # file type, in formats that have several
    seconds: float | None = None  # duration of one sway or wiggle to and fro
    fps: float | None = None  # frames per second of a film
    tell: Tell = silent
    # of a quilt for a device that states its own, as ``DisplayProfile.quilt``
    shape: tuple[int, int, int, int] | None = None

    def __post_init__(self) -> None:
        for name in ("views", "grid"):
            pair = getattr(self, name)
            if pair is not None and not (isinstance(pair, tuple | list) and len(pair) == 2 and
                                         all(1 <= count <= MOST_VIEWS for count in pair)):
                raise LfsrError(f"{name} is {pair}, but it must be two numbers from 1 to {MOST_VIEWS}, across and down")
        for name, least, most in (("eyes_mm", 1, 1000), ("width", 1, 10**5), ("seconds", 0.01, 60), ("fps", 0.01, 240)):
            value = getattr(self, name)
            if value is not None and not least <= value <= most:
                raise LfsrError(f"{name} is {value}, but it must be from {least} to {most}")


def chosen_type(options: ExportOptions, name: str) -> str:
    """File type of an export in format ``name``, by default its first; LfsrError for a type that it does not have."""
    choices = FORMATS[name].types
    if options.type is None:
        return choices[0]
    if options.type not in choices:
        raise LfsrError(f"type is {options.type!r}, but this format is written as {' or '.join(choices)}")
    return options.type


def default_target(folder: str | Path, name: str) -> Path:
    """Default folder for an export of a frame folder in format ``name``."""
    return Path(folder, "export", name)


def quilt_name(name: str, grid: Pair, aspect: float) -> str:
    """Name of a quilt's file without its ending; ``aspect``: the panel's width / height."""
    return f"{name}_qs{grid[0]}x{grid[1]}a{aspect:.4g}"


class QuiltShape(NamedTuple):
    """What a quilt's name says."""

    grid: Pair  # tiles (across, down)
    aspect: float | None  # width / height of the panel that it was made for; None: not said


def read_quilt_name(name: str) -> QuiltShape | None:
    """What a file's name says of a quilt; None where it names no tiles."""
    if not (match := SUFFIX.search(name)):
        return None
    across, down, aspect = match.groups()
    return QuiltShape((int(across), int(down)), float(aspect) if aspect and float(aspect) else None)


def without_suffix(name: str) -> str:
    """A quilt's name without its tiles and aspect ratio."""
    return SUFFIX.sub("", name)
