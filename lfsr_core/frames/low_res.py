"""The one contract that every upscaling method obeys, and the classical methods.

A method name is prefilters and one upscaler joined by "+", as ``oidn+bicubic``; "epi" after
them brings back detail that they lost, as in ``oidn+bicubic+epi``.
Low view k' covers high views s·k' … s·k' + s - 1, so pixels are sampled at
half-pixel centres.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from lfsr_core.errors import LfsrError
from lfsr_core.frames.frame import LOW_RES_FILE, Frame
from lfsr_core.optics.eia import to_elemental_images


@dataclasses.dataclass(frozen=True)
class LowResEIA:
    """What a method sees of a low-resolution frame; (sy, sx, h, w, C) float32 arrays.

    ``color``: scene-linear RGB over the background, finite, >= 0. ``alpha``:
    coverage in [0, 1], C = 1. ``aux``: "albedo", "normal", "position" where
    rendered, C = 3. ``samples``: per pixel, the noise level. ``scale``: s.
    """

    color: np.ndarray
    alpha: np.ndarray
    aux: Mapping[str, np.ndarray]
    samples: int
    scale: int


def over_background(layers: Mapping[str, np.ndarray], frame: Frame) -> np.ndarray:
    """Opaque scene-linear colour (H, W, 3) >= 0 of a render: over the world where visible, else the display's colour.

    Cycles has already weighted the environment layer by what shows of it, so it
    is added as it is. LfsrError where that layer should be there and is not.
    """
    color = layers["color"]
    if frame.world_visible:
        if "environment" not in layers:
            raise LfsrError("frame.json says that the world is visible, but the EXR has no environment layer: "
                            "render the frame again")
        return np.maximum(color[..., :3] + layers["environment"], 0)
    if not any(frame.display.background):
        return np.maximum(color[..., :3], 0)
    background = np.asarray(frame.display.background, np.float32)
    return np.maximum(color[..., :3] + (1 - np.clip(color[..., 3:], 0, 1)) * background, 0)


def low_resolution(layers: Mapping[str, np.ndarray], frame: Frame) -> LowResEIA:
    """What a method sees, from the layers of lr_eia.exr; LfsrError where their size is not the frame's."""
    width, height = frame.rays.size
    shape = layers["color"].shape
    if shape[:2] != (height, width):
        raise LfsrError(f"{LOW_RES_FILE} has {shape[1]}×{shape[0]} pixels, but frame.json says {width}×{height}: "
                        "render the frame again")

    images = {name: layers[name] for name in ("albedo", "normal", "position") if name in layers}
    images |= {"color": over_background(layers, frame), "alpha": np.clip(layers["color"][..., 3:], 0, 1)}
    aux = {name: to_elemental_images(layer, frame.rays.tiles) for name, layer in images.items()}
    return LowResEIA(aux.pop("color"), aux.pop("alpha"), aux, frame.samples, frame.scale)
