"""The world of a frame whose render shows the subject alone."""

from __future__ import annotations

from pathlib import Path

from lfsr_core.errors import LfsrError
from lfsr_core.frames.frame import WORLD_FILE, Frame
from lfsr_core.images.exr import clean, read_layers
from lfsr_core.optics.rays import RayLayout
from lfsr_core.optics.world_view import WorldImage, WorldView


def finished_layout(frame: Frame) -> RayLayout:
    """Return the rays of every view of the frame's display."""
    return RayLayout.for_display(frame.display, frame.array, convention=frame.convention,
                                 view_aperture=frame.view_aperture)


def read_world(folder: str | Path, frame: Frame) -> WorldView | None:
    """Read what the frame's display sees of the world; None where it is hidden or part of the render.

    LfsrError where its file is missing or of another size.
    """
    if not frame.world_apart:
        return None
    path, layout = Path(folder) / WORLD_FILE, finished_layout(frame)
    pixels = clean(read_layers(path))[0]["color"][..., :3]
    width, height = WorldImage.of(layout).size
    if pixels.shape[:2] != (height, width):
        raise LfsrError(f"{path} has {pixels.shape[1]}×{pixels.shape[0]} pixels, but its frame.json asks for "
                        f"{width}×{height}: render the frame again")
    return WorldView.of(layout, pixels)
