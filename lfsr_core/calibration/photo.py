"""Photographs, upright as EXIF says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import reading
from lfsr_core.images.source import opened

MOST_PIXELS = 120_000_000
LONGER_SIDE = 4200  # pixels that are enough; larger photographs are averaged down
WHITE = {"uint8": 255.0, "uint16": 65535.0}


def read_photograph(path: str | Path) -> Array:
    """Return a photograph as float32 (H, W, 3) from 0 to 1, turned and mirrored back as its EXIF orientation says.

    LfsrError if it cannot be read, has no colours or is too large.
    """
    with reading(path, "a photograph"):
        pass
    with opened(path) as source:
        spec = source.spec() if source else None
        if spec is not None:
            if spec.width * spec.height > MOST_PIXELS:
                raise LfsrError(f"{path} has {spec.width}×{spec.height} pixels, but a photograph may have "
                                f"{MOST_PIXELS // 1_000_000} million: make it smaller")
            if spec.nchannels < 3:
                raise LfsrError(f"{path} has no colours, but the pattern's channels are measured one by one: "
                                "photograph in colour")
        kind = "uint8" if spec is not None and str(spec.format) == "uint8" else "uint16"
        pixels = source.read_image(0, 0, 0, 3, kind) if source else None
        problem = source.geterror() if source else oiio.geterror()
    if spec is None or pixels is None or problem:
        line = problem.strip().partition("\n")[0].rpartition(":")[2].strip()[:80]  # of the library, without paths
        raise LfsrError(f"{path} cannot be read as a photograph{f' ({line})' if line else ''}: save it as JPEG or PNG, "
                        "or take it again")
    image, orientation = np.asarray(pixels), spec.get_int_attribute("Orientation", 1)
    if orientation in (5, 6, 7, 8):
        image = image.swapaxes(0, 1)
    image = image[::-1 if orientation in (3, 4, 7, 8) else 1, ::-1 if orientation in (2, 3, 6, 7) else 1]
    times = -(-max(image.shape) // LONGER_SIDE)
    if times == 1:
        return np.ascontiguousarray(image, np.float32) / np.float32(WHITE[kind])
    # Means of times × times pixels.
    rows, columns = (count // times * times for count in image.shape[:2])
    total = np.zeros((rows // times, columns // times, image.shape[2]), np.float32)
    for number in range(times ** 2):
        total += image[number // times:rows:times, number % times:columns:times]
    return total / times ** 2 / np.float32(WHITE[kind])
