"""Names of the export formats, in a module that is quick to import, for menus and ``--help``."""

from __future__ import annotations

from pathlib import Path

EXPORT_FOLDER = "export"  # in the frame folder
TITLES = {"quilt": "Quilt", "quilt-film": "Quilt Film", "rgbd": "RGB-D", "stereo": "Stereo Pair",
          "half-side-by-side": "Stereo Half Side by Side", "top-bottom": "Stereo Top and Bottom",
          "half-top-bottom": "Stereo Half Top and Bottom", "anaglyph": "Anaglyph", "wiggle": "Wiggle",
          "sway": "Sway Film", "views": "Views", "hci": "HCI Benchmark", "stanford": "Stanford Archive",
          "pleno": "JPEG Pleno"}
DESCRIPTIONS = {
    "quilt": "one image of all views at eye level, for Looking Glass displays",
    "quilt-film": "the quilts of an animation as a film",
    "rgbd": "colour and depth side by side, for Looking Glass displays",
    "stereo": "the views of two eyes, side by side",
    "half-side-by-side": "the views of two eyes at half width, side by side, for 3D monitors and glasses",
    "top-bottom": "the views of two eyes, the left one above",
    "half-top-bottom": "the views of two eyes at half height, the left one above",
    "anaglyph": "the views of two eyes in red and cyan, for paper glasses",
    "wiggle": "a short film that changes between two eyes, for people without any display",
    "sway": "a short film of an eye that sways in front of the display",
    "views": "every view as PNG, or as one part of a scene-linear EXR",
    "hci": "views, parameters.cfg and disparity as in the HCI 4D light field benchmark",
    "stanford": "views named by their places, as in the Stanford light field archive",
    "pleno": "views as PPM, named as in the JPEG Pleno test sets",
}
# Types of files; the first is the default.
FILM_TYPES = ("mp4", "gif", "webp", "png")
WIGGLE_TYPES = ("gif", "webp", "mp4", "png")
QUILT_FILM_TYPES = ("mp4", "png")
VIEW_TYPES = ("png", "exr")
FILMS, FILM_RATE = ("sway", "wiggle"), 30.0  # of one frame, and their frames a second
QUILT_FILM = "quilt-film"  # of an animation
H264_SIDE = 6000  # pixels; films of longer sides are HEVC


def default_target(folder: str | Path, name: str) -> Path:
    """Default folder for an export of a frame folder in format ``name``."""
    return Path(folder, EXPORT_FOLDER, name)
