"""Open Image Denoise on a whole EIA.

The EIA, not decoded views: views of the low-resolution array lie far apart, the
pixels inside one EI do not, so the EIA keeps far more detail (measured).
"""

from __future__ import annotations

import dataclasses
import importlib
import importlib.util
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from lfsr_core import oidn
from lfsr_core.eia import from_elemental_images, to_elemental_images
from lfsr_core.errors import LfsrError

if TYPE_CHECKING:
    from lfsr_core.upscale import LowResEIA


def denoise_eia(color: np.ndarray, albedo: np.ndarray | None = None, normal: np.ndarray | None = None) -> np.ndarray:
    """Denoised scene-linear colour, (H, W, 3) float32 >= 0.

    ``color`` (H, W, 3) scene-linear >= 0, any range; ``albedo`` (H, W, 3) in
    [0, 1] and ``normal`` (H, W, 3) in [-1, 1] of the same noisy render help where
    present; a normal counts only together with an albedo, as the library asks.
    LfsrError where the library is missing or fails.
    """
    guides = {"albedo": albedo, "normal": normal} if albedo is not None else {}
    guides = {name: np.asarray(image, np.float32) for name, image in guides.items() if image is not None}
    try:
        denoised = _library().denoise(np.asarray(color, np.float32), **guides, hdr=True)
    except (ImportError, RuntimeError) as error:
        raise LfsrError(f"Open Image Denoise failed on an image of shape {color.shape} ({error}): "
                        "choose a method without 'oidn'") from None
    return np.maximum(denoised, 0)


def denoise_low_resolution(low: LowResEIA) -> LowResEIA:
    """The low-resolution EIA with denoised colour; what was rendered stays in the layer "noisy"."""
    sy, sx = low.color.shape[:2]
    guides = {name: from_elemental_images(low.aux[name]) for name in ("albedo", "normal") if name in low.aux}
    denoised = denoise_eia(from_elemental_images(low.color), **guides)
    return dataclasses.replace(low, color=to_elemental_images(denoised, (sx, sy)), aux={**low.aux, "noisy": low.color})


def is_available() -> bool:
    """True if this Python has pyoidn or finds Blender's library."""
    return importlib.util.find_spec("pyoidn") is not None or oidn.find_library() is not None


def _library() -> ModuleType:
    """The package pyoidn, else Blender's library; they give the same image."""
    try:
        return importlib.import_module("pyoidn")
    except ImportError as error:
        if oidn.find_library() is not None:
            return oidn
        raise LfsrError(f"Open Image Denoise is not available ({error}): install the package pyoidn, "
                        "or choose a method without 'oidn'") from None
