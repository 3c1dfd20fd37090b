"""The tasks of the add-on that work on one frame folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.files import atomic_path
from lfsr_core.frames.frame import MASK_FILE, read_frame
from lfsr_core.render.protocol import emit_progress


def upscale(folder: str, method: str, linear_exr: bool = False, views: str | None = None) -> dict[str, Any]:
    """Finish a rendered frame folder.

    Parameters
    ----------
    folder, method : what to finish, and how
    linear_exr : whether eia.exr is written too
    views : file for ``decode``, None for none

    Returns
    -------
    "method" and "seconds" per stage
    """
    from lfsr_core.reconstruct.options import UpscaleOptions
    from lfsr_core.reconstruct.second_stage import upscale_frame

    report = upscale_frame(folder, method, UpscaleOptions(linear_exr=linear_exr, progress=emit_progress))
    if views:
        decode(folder, views)
    return {"method": report.method, "seconds": report.seconds}


def decode(folder: str, views: str) -> dict[str, Any]:
    """Write the decoded views of a finished folder as a .npy, uint8 (py, px, sy, sx, 3).

    Row 0 is the topmost camera; one view is contiguous, so that a reader that maps
    the file touches a few kB per view. Result: its shape.
    """
    from lfsr_core.frames.views import read_views

    emit_progress("preview", 0.0, "decoding views")
    decoded = read_views(folder)
    with atomic_path(views) as temporary, temporary.open("wb") as file:
        np.save(file, decoded)
    return {"shape": list(decoded.shape)}


def choose(folder: str, count: int, seed: int = 0) -> dict[str, Any]:
    """Lenses of a finished folder to compare: (row, column) pairs, none for all if ``count`` is 0 or too large."""
    from lfsr_core.images.png import read_mask
    from lfsr_core.optics.lens_sampling import choose_lenses

    mask = read_mask(Path(folder, MASK_FILE), read_frame(folder).display.lenses)
    whole = count < 1 or count >= mask.size
    return {"lens_list": None if whole else [list(lens) for lens in choose_lenses(mask, count, seed)]}


def check(method: str) -> dict[str, Any]:
    """LfsrError if this Python cannot run ``method``, as a network without PyTorch: better known before the render."""
    from lfsr_core.reconstruct.registry import method as load

    return {"method": load(method).name.text}


def compare(folder: str, reference: str) -> dict[str, Any]:
    """Metrics of a finished folder against a reference folder, also written into its report."""
    from lfsr_core.frames.report import read_report
    from lfsr_core.metrics.compare import compare_folders

    emit_progress("compare", 0.0, "comparing")
    compare_folders(folder, reference)
    return {"metrics": read_report(folder).metrics}
