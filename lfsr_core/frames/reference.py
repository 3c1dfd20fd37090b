"""A frame folder against a reference folder: is it the same picture, and how close."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfsr_core.errors import LfsrError
from lfsr_core.frames.frame import Frame


def read_half(path: Path, truth: Frame) -> tuple[np.ndarray, np.ndarray]:
    """One half of a reference: (H, W, 3) scene-linear over its background, and (rows, columns) of tiles with any hit.

    LfsrError where the file is missing or of another size.
    """
    from lfsr_core.frames.foreground import foreground_mask
    from lfsr_core.frames.low_res import over_background
    from lfsr_core.images.exr import clean, read_layers

    layers = clean(read_layers(path))[0]
    pixels = over_background(layers, truth)
    width, height = truth.rays.size
    if pixels.shape[:2] != (height, width):
        raise LfsrError(f"{path} has {pixels.shape[1]}×{pixels.shape[0]} pixels, but its frame.json says "
                        f"{width}×{height}: render the reference again")
    return pixels, foreground_mask(layers, truth.rays.tiles)


def check_reference(frame: Frame, reference: Frame) -> None:
    """LfsrError unless ``reference`` shows at full resolution what ``frame`` shows."""
    if reference.scale != 1:
        raise LfsrError(f"the reference has scale {reference.scale}, but it must be 1: render it with 'lfsr reference'")
    pairs = {"display": (frame.display, reference.display), "convention": (frame.convention, reference.convention),
             "frame number": (frame.frame, reference.frame)}
    for name, (ours, theirs) in pairs.items():
        if ours != theirs:
            shown = (ours.name, theirs.name) if name == "display" and ours.name != theirs.name else (ours, theirs)
            raise LfsrError(f"the reference was rendered with {name} {shown[1]}, but the frame with {shown[0]}: "
                            "render the reference of the same frame")
    if not _same_place(frame, reference):
        raise LfsrError(f"the reference's cameras are at {reference.array}, but the frame's at {frame.array}, or they "
                        "face elsewhere: render the reference of the same frame")
    if frame.lens_list is not None and frame.lens_list != reference.lens_list:
        raise LfsrError(f"the reference shows other lenses than the {len(frame.lens_list)} of the frame: "
                        "render it for the same list")


def _same_place(frame: Frame, reference: Frame) -> bool:
    def numbers(of: Frame) -> list[float]:
        array = of.array
        return [array.distance, array.half_width, array.half_height, array.spacing, *np.ravel(of.matrix_world)]
    tolerance = 1e-5 * frame.array.distance
    return np.allclose(numbers(frame), numbers(reference), rtol=1e-5, atol=tolerance)
