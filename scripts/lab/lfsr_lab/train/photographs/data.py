"""Photographs for training: decoded once, stored as bytes on the device and cropped there."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_lab.networks.srgb import srgb_decode, srgb_encode
from lfsr_lab.train.reading import open_data

SUFFIXES = {".jpg", ".jpeg", ".png", ".webp", ".tif", ".tiff"}


@dataclass(frozen=True)
class Photographs:
    """``names`` and (H, W, 3) uint8 RGB ``images``; ``digest`` is the SHA-256 over both."""

    names: tuple[str, ...]
    images: tuple[Array, ...]

    @property
    def digest(self) -> str:
        """Hexadecimal digits, equal for the same photographs under the same names."""
        state = hashlib.sha256()
        for name, image in zip(self.names, self.images, strict=True):
            state.update(f"{name} {image.shape}\n".encode())
            state.update(image.tobytes())
        return state.hexdigest()

    def facts(self) -> dict[str, Any]:
        """Number, size and digest, for the provenance."""
        pixels = sum(image.shape[0] * image.shape[1] for image in self.images)
        return {"files": len(self.names), "megapixels": round(pixels / 1e6, 2), "sha256": self.digest}


def load_photographs(folder: str | Path, long_side: int | None = None) -> Photographs:
    """Read the photographs of a folder; larger ones are reduced by areas to ``long_side``.

    LfsrError if there are none or one cannot be decoded.
    """
    paths = sorted(path for path in Path(folder).glob("*") if path.suffix.lower() in SUFFIXES)
    if not paths:
        raise LfsrError(f"{folder} holds no photographs ({', '.join(sorted(SUFFIXES))}): give a folder that does")
    return Photographs(tuple(path.name for path in paths), tuple(_decode(path, long_side) for path in paths))


def _decode(path: Path, long_side: int | None) -> Array:
    with open_data(path, "a photograph", "remove it or get it again") as file:
        found: Any = cv2.imdecode(np.frombuffer(file.read(), np.uint8), cv2.IMREAD_COLOR)
        image = np.ascontiguousarray(found[..., ::-1])
    longest = max(image.shape[:2])
    if long_side is None or longest <= long_side:
        return image
    size = [round(side * long_side / longest) for side in image.shape[1::-1]]
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)


class CropSampler:
    """Random crops of ``size`` pixels, ``per_photograph`` in an epoch, cut on the device that stores the photographs.

    Epoch e depends on (seed, e) alone, so a resumed run sees the same crops as
    an uninterrupted one. LfsrError if a photograph is smaller than a crop.
    """

    def __init__(self, photographs: Photographs, size: int, per_photograph: int, seed: int,
                 device: torch.device) -> None:
        for name, image in zip(photographs.names, photographs.images, strict=True):
            if min(image.shape[:2]) < size:
                raise LfsrError(f"photograph {name} is smaller than a crop of {size} pixels: remove it or "
                                f"choose a smaller crop")
        self._sizes = np.array([image.shape[:2] for image in photographs.images])
        self._starts = np.concatenate([[0], np.cumsum(self._sizes.prod(axis=1))[:-1]])
        pixels = np.concatenate([image.reshape(-1, 3) for image in photographs.images])
        self._pixels = torch.from_numpy(pixels).to(device)
        self._size, self._per_photograph, self._seed = size, per_photograph, seed
        self._ramp = torch.arange(size, device=device)

    def begin(self, epoch: int, batch: int) -> None:
        """Draw the crops of an epoch in batches; a smaller last batch is dropped unless it is the only one."""
        rng = np.random.default_rng([self._seed, epoch])
        photograph = rng.permutation(np.repeat(np.arange(len(self._sizes)), self._per_photograph))
        room = self._sizes[photograph] - self._size + 1
        top, left = (rng.integers(room[:, axis]) for axis in (0, 1))
        width = self._sizes[photograph, 1]
        corner = self._starts[photograph] + top * width + left
        self._turns = rng.integers(8, size=max(1, len(photograph) // batch))
        self._place = torch.from_numpy(np.stack([corner, width], axis=1)).to(self._pixels.device).split(batch)

    def __len__(self) -> int:
        return len(self._turns)

    def __getitem__(self, index: int) -> Tensor:
        """Batch (B, 3, size, size) float32 in [0, 1], flipped and transposed as one."""
        corner, width = self._place[index][:, :, None, None].unbind(1)
        crops = self._pixels[corner + self._ramp[:, None] * width + self._ramp]
        crops = crops.permute(0, 3, 1, 2).float() / 255
        turn = int(self._turns[index])
        axes = [axis for bit, axis in ((1, 2), (2, 3)) if turn & bit]
        crops = crops.flip(axes) if axes else crops
        return crops.transpose(2, 3) if turn & 4 else crops


def downsample(high: Tensor, scale: int) -> Tensor:
    """Average the light of sRGB values (N, 3, H, W) -> (N, 3, H/s, W/s), as a low-resolution render does."""
    return srgb_encode(F.avg_pool2d(srgb_decode(high), scale))
