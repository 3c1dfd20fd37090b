"""Names of the export formats, in a module that is quick to import, for menus and ``--help``."""

from __future__ import annotations

from pathlib import Path

EXPORT_FOLDER = "export"  # in the frame folder
TITLES = {"quilt": "Quilt", "hci": "HCI Benchmark", "stanford": "Stanford Archive", "stereo": "Stereo Pair",
          "views": "Views", "sway": "Sway Film", "pleno": "JPEG Pleno"}
DESCRIPTIONS = {
    "quilt": "one image of all views at eye level, for Looking Glass displays",
    "hci": "views, parameters.cfg and disparity as in the HCI 4D light field benchmark",
    "stanford": "views named by their places, as in the Stanford light field archive",
    "stereo": "the views of two eyes, side by side",
    "views": "every view as PNG, or as one part of a scene-linear EXR",
    "sway": "a short film of an eye that sways in front of the display",
    "pleno": "views as PPM, named as in the JPEG Pleno test sets",
}
FILM_TYPES = ("mp4", "gif", "webp", "png")
VIEW_TYPES = ("png", "exr")


def default_target(folder: str | Path, name: str) -> Path:
    """Default folder for an export of a frame folder in format ``name``."""
    return Path(folder, EXPORT_FOLDER, name)
