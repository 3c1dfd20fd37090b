"""Methods of the second stage as the panel lists them."""

from __future__ import annotations

import zlib

from lfsr_core.reconstruct.method_name import DEFAULT_METHOD, FAST_METHOD

DIRECT = "Direct Subpixel Rendering"
# Titles must fit into a narrow sidebar; the tooltips say the rest.
METHODS = {
    DEFAULT_METHOD: ("Default", "Denoise, interpolate; then detail lost as noise returns along epipolar lines"),
    FAST_METHOD: ("Fast", "Denoise the whole array, then make the missing views by linear interpolation"),
    "denoise": ("Every View", "Render every view, at scale 1×, and denoise"),
}
MORE = {
    "denoise+lanczos": ("Denoise + Lanczos", "Denoise, then the sharpest interpolation"),
    "oidn+bilinear": ("Stock + Bilinear", "Open Image Denoise with its own weights, then linear interpolation"),
    "oidn": ("Stock Only", "Open Image Denoise with its own weights, for scale 1×, where every view is rendered"),
    "bilinear": ("Bilinear", "Linear interpolation; the noise stays: fastest"),
    "bicubic": ("Bicubic", "Bicubic interpolation; the noise stays"),
    "lanczos": ("Lanczos", "Lanczos interpolation; the noise stays"),
    "nearest": ("Nearest", "Repeat each rendered view, to see what was rendered"),
    "none": ("None", "For scale 1×, where every view is rendered; the noise stays"),
}


def title(name: str) -> str:
    """Title of a method in the menu; of one that is not in it, its name."""
    return (METHODS | MORE).get(name, (name, ""))[0]


def method_items() -> list[tuple[str, str, str, str, int]]:
    """Enum items; each has a number of its own, so that new methods do not change saved scenes."""
    return [*_items(METHODS), ("", "More", "", "NONE", 0), *_items(MORE)]


def _items(methods: dict[str, tuple[str, str]]) -> list[tuple[str, str, str, str, int]]:
    return [(name, title, text, "NONE", zlib.crc32(name.encode()) & 0x7FFFFFFF)
            for name, (title, text) in methods.items()]
