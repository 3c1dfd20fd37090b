"""Second-stage methods as an artist sees them."""

from __future__ import annotations

import zlib

from lfsr_core.errors import LfsrError
from lfsr_core.reconstruct.method_name import MethodName
from lfsr_core.reconstruct.networks import catalogue

# The pure second stage knows more; these are worth a menu entry, best first.
OURS = {
    "oidn-both+refine+epi": ("Denoise + Refine + Recover", "Open Image Denoise at half and at full resolution, our "
                                                           "network takes the best of both, and detail that they took "
                                                           "for noise comes back along epipolar lines"),
    "oidn-both+refine": ("Denoise + Refine", "Open Image Denoise at half and at full resolution, then our network "
                                             "takes the best of both"),
    "light": ("Light", "Our network alone denoises and upscales each elemental image, without Open Image Denoise"),
}
CLASSICAL = {
    "oidn+bilinear": ("Denoise + Bilinear", "Open Image Denoise on the whole array, then linear views"),
    "oidn+bilinear+epi": ("Denoise + Bilinear + Recover", "The same, and detail that the denoiser took for noise comes "
                                                          "back along epipolar lines"),
    "oidn-fast+bilinear": ("Fast Denoise + Bilinear", "Open Image Denoise in half the time, then linear views"),
    "oidn-half+bilinear+epi": ("Half Denoise + Bilinear + Recover", "Open Image Denoise at half the resolution where "
                                                                    "that shows the same: for 1 to 4 samples"),
    "oidn-guided+bilinear+epi": ("Guided Denoise + Bilinear + Recover", "Open Image Denoise with albedo and normal, "
                                                                        "linear views, and detail comes back"),
    "oidn-guided+bilinear": ("Guided Denoise + Bilinear", "Open Image Denoise with albedo and normal, linear views"),
    "oidn+bicubic": ("Denoise + Bicubic", "Open Image Denoise on the whole array, then sharper bicubic views"),
    "oidn+lanczos": ("Denoise + Lanczos", "Open Image Denoise on the whole array, then the sharpest, Lanczos views"),
    "oidn-render+bilinear": ("Denoise in Cycles + Bilinear", "Open Image Denoise by Cycles on the device that renders, "
                                                             "then linear views: quickest with a GPU"),
    "bicubic": ("Bicubic", "Bicubic views, noise kept"),
    "lanczos": ("Lanczos", "Lanczos views, noise kept"),
    "bilinear": ("Bilinear", "Linear views, noise kept: fastest"),
    "nearest": ("Nearest", "Each rendered view repeated, to see what was rendered"),
    "oidn": ("Denoise Only", "For scale 1×: every view was rendered"),
    "none": ("None", "For scale 1×: every view was rendered, noise kept"),
}


def method_items() -> list[tuple[str, str, str, str, int]]:
    """Enum items; each has a number of its own, so that new methods do not change saved scenes."""
    entries = {name: (title, text, "NONE") for name, (title, text) in (OURS | CLASSICAL).items()}
    for name, text in catalogue.NAMES.items():
        if catalogue.trained_scales(name) and not catalogue.NETWORKS[name].light_field:
            entries[name] = (name.replace("-", " ").title(), text[:1].upper() + text[1:], "NODETREE")
    return [(name, *entry, zlib.crc32(name.encode()) & 0x7FFFFFFF) for name, entry in entries.items()]


def check_scale(method: str, scale: int) -> None:
    """LfsrError if a network of ``method`` was not trained for ``scale``."""
    for name in MethodName.parse(method).untrained(scale):
        trained = ", ".join(f"{s}×" for s in catalogue.trained_scales(name))
        raise LfsrError(f"method {name!r} was not trained for scale {scale}× but for {trained}: "
                        "choose one of these or another method")
