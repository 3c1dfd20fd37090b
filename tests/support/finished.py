"""Finished frame folders of things at known depths, without Blender."""

import dataclasses
from pathlib import Path

import numpy as np
from PIL import Image

from lfsr_core.frames.frame import EIA_FILE, EIA_LINEAR_FILE, LOW_RES_FILE, Frame, write_frame
from lfsr_core.images.color import srgb_encode
from lfsr_core.images.image_files import write_layers, write_png
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.optics.rays import flip_order
from tests.support.card_rays import pixel_rays
from tests.support.synthetic import frame_of

MINI = load_display("mini")
TALL = DisplayProfile.from_dict(MINI.to_dict() | {
    "name": "tall", "views": [8, 12], "panel_pixels": [128, 144],
    "panel_mm": [MINI.panel_mm[0], MINI.panel_mm[0] * 144 / 128]})
DIRECT = dataclasses.replace(MINI, name="direct", ei_order="direct")
# As a camera array in a scene: moved, and turned about its vertical axis.
TURNED = ((0.8, 0.0, 0.6, 2.0), (0.0, 1.0, 0.0, -1.0), (-0.6, 0.0, 0.8, 3.0), (0.0, 0.0, 0.0, 1.0))
NEAR, FAR = 0.8, 1.25  # of the distance to the display


def two_depths(frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """EIA (H, W, 4) in view order of a textured wall behind the display and a textured square before it, and where
    each pixel hit, (H, W, 3) in world space."""
    origin, direction = pixel_rays(frame.rays)
    hits = {depth: origin + direction * (depth * frame.array.distance / direction[..., 2:]) for depth in (FAR, NEAR)}
    x, y, _ = np.moveaxis(hits[NEAR], -1, 0)
    near = (np.abs(x + 0.1) < 0.25) & (np.abs(y - 0.1) < 0.25)
    hit = np.where(near[..., None], hits[NEAR], hits[FAR])
    x, y, _ = np.moveaxis(hit, -1, 0)
    waves = np.stack([0.5 + 0.45 * np.sin(14 * x + 3 * y), 0.4 + 0.35 * np.cos(11 * y - 2 * x), near * 0.8 + 0.1], -1)
    # The camera plane is the world's, but for the rotation and the move of the frame's matrix.
    world = hit @ np.asarray(frame.matrix_world)[:3, :3].T + np.asarray(frame.matrix_world)[:3, 3]
    return np.concatenate([waves, np.ones_like(near)[..., None]], -1).astype(np.float32), world.astype(np.float32)


def finished(folder: Path, display: DisplayProfile = MINI, scale: int = 2, **changes: object) -> Path:
    """Finished frame folder of ``two_depths`` with its position layer and eia.exr."""
    folder.mkdir(parents=True, exist_ok=True)
    frame = frame_of(scale, display, **{"layers": ("position",), "scene": "two depths.blend"} | changes)
    low, position = two_depths(frame)
    write_layers(folder / LOW_RES_FILE, {"color": low, "position": position})
    write_frame(folder, frame)
    high = low if scale == 1 else two_depths(dataclasses.replace(frame, scale=1))[0]
    linear = high[..., :3]
    panel = flip_order(linear, display.lenses) if display.ei_order == "flipped" else linear
    write_png(folder / EIA_FILE, np.rint(srgb_encode(panel) * 255).astype(np.uint8))
    write_layers(folder / EIA_LINEAR_FILE, {"color": panel}, half=True)
    return folder


def picture(path: Path) -> np.ndarray:
    """A PNG, JPEG or WebP as others read it, (H, W, 3) uint8."""
    return np.asarray(Image.open(path).convert("RGB"))
