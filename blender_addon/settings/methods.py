"""Methods of the second stage as the panel lists them."""

from __future__ import annotations

import zlib

from lfsr_core.errors import LfsrError
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.reconstruct.networks import catalogue

DIRECT = "Direct Subpixel Rendering"
# Methods that deserve a menu entry, best first. A title must fit into a narrow sidebar; the tooltip says the rest.
METHODS = {
    "oidn-both+refine+epi": ("Refine + Recover", "Open Image Denoise at half and at full resolution; our network takes "
                             "the best of both, and detail that both took for noise returns along epipolar lines"),
    "oidn-both+refine": ("Refine", "Open Image Denoise at half and at full resolution; our network takes the best of "
                         "both"),
    "light": ("Light", "Our network alone denoises and upscales each elemental image, without Open Image Denoise"),
    "oidn+bilinear": ("Denoise + Bilinear", "Open Image Denoise on the whole array, then linear interpolation"),
    "oidn+bilinear+epi": ("Bilinear + Recover", "Open Image Denoise, linear interpolation, then detail that the "
                          "denoiser took for noise returns along epipolar lines"),
    "oidn-fast+bilinear": ("Fast + Bilinear", "Open Image Denoise in half the time, then linear interpolation"),
    "oidn-half+bilinear+epi": ("Half + Recover", "Open Image Denoise at half the resolution where that shows the same, "
                               "linear interpolation, and detail returns: for 1 to 4 samples"),
    "oidn-guided+bilinear+epi": ("Guided + Recover", "Open Image Denoise with albedo and normal, linear interpolation, "
                                 "and detail returns"),
    "oidn-guided+bilinear": ("Guided + Bilinear", "Open Image Denoise with albedo and normal, then linear "
                             "interpolation"),
    "oidn+bicubic": ("Denoise + Bicubic", "Open Image Denoise on the whole array, then the sharper bicubic "
                     "interpolation"),
    "oidn+lanczos": ("Denoise + Lanczos", "Open Image Denoise on the whole array, then the sharpest interpolation, "
                     "Lanczos"),
    "oidn-render+bilinear": ("Cycles + Bilinear", "Open Image Denoise by Cycles on the device that renders, then "
                             "linear interpolation: quickest with a GPU"),
    "bicubic": ("Bicubic", "Bicubic interpolation; the noise stays"),
    "lanczos": ("Lanczos", "Lanczos interpolation; the noise stays"),
    "bilinear": ("Bilinear", "Linear interpolation; the noise stays: fastest"),
    "nearest": ("Nearest", "Repeat each rendered view, to see what was rendered"),
    "oidn": ("Denoise Only", "For scale 1×, where every view is rendered"),
    "none": ("None", "For scale 1×, where every view is rendered; the noise stays"),
}


def method_items() -> list[tuple[str, str, str, str, int]]:
    """Enum items; each has a number of its own, so that new methods do not change saved scenes."""
    entries = {name: (title, text, "NONE") for name, (title, text) in METHODS.items()}
    for name, text in catalogue.NAMES.items():
        if catalogue.trained_scales(name) and not catalogue.NETWORKS[name].light_field:
            entries[name] = (name.replace("-", " ").title(), text[:1].upper() + text[1:], "NODETREE")
    return [(name, *entry, zlib.crc32(name.encode()) & 0x7FFFFFFF) for name, entry in entries.items()]


def check_scale(method: MethodName, scale: int) -> None:
    """LfsrError if a network of ``method`` was not trained for ``scale``."""
    for name in method.untrained(scale):
        trained = ", ".join(f"{s}×" for s in catalogue.trained_scales(name))
        raise LfsrError(f"method {name!r} was not trained for scale {scale}× but for {trained}: "
                        "choose one of these or another method")
