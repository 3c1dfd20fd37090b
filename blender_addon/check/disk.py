"""Is there room for the images, and for what is written while they are made?"""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterator
from pathlib import Path

import bpy

from lfsr_core.base.errors import LfsrError

from ..scene import folders
from ..scene import settings as scene_settings
from ..scene.settings import Resolved
from .problem import ERROR, Problem

# Bytes per rendered pixel of all layers, per finished pixel of an image, of its linear copy, and of its decoded views.
RENDERED, IMAGE, LINEAR, VIEWS = 48, 3, 6, 3
GIGABYTE = 1e9


def find(scene: bpy.types.Scene, frames: int = 1) -> Iterator[Problem]:
    """The disks that have too little room for ``frames`` images of ``scene``."""
    try:
        settings, folder = scene_settings.resolve(scene), folders.scene_folder(scene)
    except LfsrError:
        return  # said elsewhere
    needed = frames * bytes_of_frame(settings)
    if free(folder) < needed:
        yield _problem("disk", "the disk of the output folder", needed, folder, "Choose Folder…")
    temporary = Path(bpy.app.tempdir)
    if free(temporary) < (needed := bytes_of_work(settings)):
        yield _problem("temporary", "the disk of Blender's temporary files", needed, temporary, "Choose Folder…")


def bytes_of_frame(settings: Resolved) -> int:
    """Bytes that one image may take in its frame folder, uncompressed."""
    finished = math.prod(settings.display.panel_pixels if settings.subpixels else settings.display.eia_pixels)
    rendered = finished // settings.display.finished_pixels(settings.sampling.scale)
    return RENDERED * rendered + (IMAGE + LINEAR * settings.finish.linear_exr) * finished


def bytes_of_work(settings: Resolved) -> int:
    """Bytes of the temporary files of one render: a copy of the open file, and the decoded views."""
    file = Path(bpy.data.filepath)
    return VIEWS * math.prod(settings.display.eia_pixels) + (file.stat().st_size if file.is_file() else 0)


def free(folder: Path) -> float:
    """Free bytes of the disk that ``folder`` is on or will be; infinite where that cannot be told."""
    for place in (folder, *folder.parents):
        try:
            return shutil.disk_usage(place).free
        except FileNotFoundError:
            continue
        except OSError:
            break
    return float("inf")


def _problem(code: str, disk: str, needed: float, folder: Path, fix: str) -> Problem:
    return Problem(code, "Disk Space", f"The render needs up to {needed / GIGABYTE:.2g} GB, but {disk} has only "
                   f"{free(folder) / GIGABYTE:.2g} GB free.", fix, ERROR, asks=True)
