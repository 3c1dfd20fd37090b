"""Formats of ``lfsr export`` by name, apart from what writes them: menus and ``--help`` are to be quick."""

from __future__ import annotations

from pathlib import Path

EXPORT_FOLDER = "export"  # in the frame folder
TITLES = {"quilt": "Quilt", "hci": "HCI Benchmark", "stanford": "Stanford Archive", "stereo": "Stereo Pair",
          "views": "Views", "sway": "Sway Film", "pleno": "JPEG Pleno"}
DESCRIPTIONS = {
    "quilt": "one picture of all views at eye level, for Looking Glass displays",
    "hci": "views, parameters.cfg and disparity as in the HCI 4D light field benchmark",
    "stanford": "views named by their places, as in the Stanford light field archive",
    "stereo": "a pair for two eyes, side by side",
    "views": "every view as PNG, or as one part of a scene-linear EXR",
    "sway": "a short film of an eye that sways in front of the display",
    "pleno": "views as PPM, named as in the JPEG Pleno test sets",
}
FILM_TYPES = ("mp4", "gif", "webp", "png")
VIEW_TYPES = ("png", "exr")


def default_target(folder: str | Path, name: str) -> Path:
    """Folder that a frame folder's export in format ``name`` goes to."""
    return Path(folder, EXPORT_FOLDER, name)
