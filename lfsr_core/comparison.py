"""A frame folder against a reference folder: is it the same picture, and how close."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json, write_json
from lfsr_core.frame import MASK_FILE, REFERENCE_FILES, REPORT_FILE, Frame, read_frame


def compare_folders(folder: str | Path, reference: str | Path) -> dict[str, Any]:
    """Metrics of ``folder`` against ``reference``, also written into its report.json.

    Keys as in docs/frame-folder.md. LfsrError where either folder is incomplete
    or the two do not show the same picture.
    """
    from lfsr_core.image_io import read_mask
    from lfsr_core.metrics import check_reference, compare
    from lfsr_core.pipeline import finished_linear

    folder, reference = Path(folder), Path(reference)
    frame, truth = read_frame(folder), read_frame(reference)
    check_reference(frame, truth)
    report = read_json(folder / REPORT_FILE, "the report of `lfsr render` or `lfsr upscale`")
    image = finished_linear(folder, report["method"], dilate=report.get("dilate", 0))
    half_a, half_b = (_read_half(reference / name, truth) for name in REFERENCE_FILES)
    report["metrics"] = compare(image, half_a, half_b, frame.display.lenses, read_mask(folder / MASK_FILE),
                                lens_list=truth.lens_list)
    write_json(folder / REPORT_FILE, report)
    return report["metrics"]


def _read_half(path: Path, truth: Frame) -> np.ndarray:
    """(H, W, 3) scene-linear over its background; LfsrError where it is missing or of another size."""
    from lfsr_core.image_io import clean, read_layers
    from lfsr_core.pipeline import over_background

    pixels = over_background(clean(read_layers(path))[0], truth)
    width, height = truth.rays.size
    if pixels.shape[:2] != (height, width):
        raise LfsrError(f"{path} has {pixels.shape[1]}×{pixels.shape[0]} pixels, but its frame.json says "
                        f"{width}×{height}: render the reference again")
    return pixels
