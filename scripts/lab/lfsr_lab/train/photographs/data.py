"""Photographs for training: decoded once, stored as bytes on the device and cropped there."""

from __future__ import annotations

import hashlib
import zipfile
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.files import atomic_path
from lfsr_lab.networks.srgb import srgb_decode, srgb_encode

SUFFIXES = {".jpg", ".jpeg", ".png", ".webp", ".tif", ".tiff"}
CACHE_FORMAT = "lfsr-photographs-1"


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


def load_photographs(source: str | Path, long_side: int | None = None) -> Photographs:
    """Read the photographs of a folder or a cache file; larger ones are reduced by areas to ``long_side``.

    LfsrError if there are none or one cannot be decoded.
    """
    source = Path(source)
    if source.is_file():
        return _read_cache(source)
    paths = sorted(path for path in source.glob("*") if path.suffix.lower() in SUFFIXES)
    if not paths:
        raise LfsrError(f"{source} holds no photographs ({', '.join(sorted(SUFFIXES))}): give a folder that does, "
                        f"or a cache made with --prepare-photographs")
    return Photographs(tuple(path.name for path in paths), tuple(_decode(path, long_side) for path in paths))


def write_cache(photographs: Photographs, path: str | Path, quality: int = 92) -> int:
    """Write photographs into one .npz, as JPEG or, with ``quality`` above 100, lossless; return its size in bytes."""
    encoded = {f"image{index:04d}": _encode(image, quality) for index, image in enumerate(photographs.images)}
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        np.savez(file, format=np.array(CACHE_FORMAT), names=np.array(photographs.names), **encoded)
    return Path(path).stat().st_size


def _encode(image: Array, quality: int) -> Array:
    suffix, options = ".webp", [cv2.IMWRITE_WEBP_QUALITY, 101]
    if quality <= 100:
        # Full colour resolution: trained on subsampled colour, a network would learn to blur it.
        suffix = ".jpg"
        options = [cv2.IMWRITE_JPEG_QUALITY, quality,
                   cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
    done, data = cv2.imencode(suffix, image[..., ::-1], options)
    assert done, f"OpenCV did not encode {suffix}"
    return data


def _read_cache(path: Path) -> Photographs:
    try:
        with np.load(path, allow_pickle=False) as data:
            if "format" not in data or str(data["format"]) != CACHE_FORMAT:
                raise ValueError("it has another format")
            names = tuple(str(name) for name in data["names"])
            images = tuple(_to_rgb(cv2.imdecode(data[f"image{index:04d}"], cv2.IMREAD_COLOR), path)
                           for index in range(len(names)))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        if isinstance(error, LfsrError):
            raise
        raise LfsrError(f"{path} cannot be read as a cache of photographs ({error}): make it with "
                        f"--prepare-photographs") from None
    return Photographs(names, images)


def _decode(path: Path, long_side: int | None) -> Array:
    image = _to_rgb(cv2.imread(str(path), cv2.IMREAD_COLOR), path)
    longest = max(image.shape[:2])
    if long_side is None or longest <= long_side:
        return image
    size = [round(side * long_side / longest) for side in image.shape[1::-1]]
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)


def _to_rgb(image: Array | None, path: Path) -> Array:
    if image is None:
        raise LfsrError(f"{path} cannot be decoded as an image: remove it or get it again")
    return np.ascontiguousarray(image[..., ::-1])


@dataclass(frozen=True)
class Crops:
    """Crops of an epoch."""

    size: int  # side in pixels
    per_photograph: int
    seed: int
    augment: bool = True  # flip and transpose whole batches


class CropSampler:
    """Random crops of photographs, cut on the device that stores them.

    Epoch e depends on (seed, e) alone, so a resumed run sees the same crops as
    an uninterrupted one. LfsrError if a photograph is smaller than a crop.
    """

    def __init__(self, photographs: Photographs, crops: Crops, device: torch.device) -> None:
        for name, image in zip(photographs.names, photographs.images, strict=True):
            if min(image.shape[:2]) < crops.size:
                raise LfsrError(f"photograph {name} is smaller than a crop of {crops.size} pixels: remove it or "
                                f"choose a smaller crop")
        self._sizes = np.array([image.shape[:2] for image in photographs.images])
        ends = np.cumsum(self._sizes.prod(axis=1))
        self._starts = np.concatenate([[0], ends[:-1]])
        pixels = np.concatenate([image.reshape(-1, 3) for image in photographs.images])
        self._pixels = torch.from_numpy(pixels).to(device)
        self._crops, self._ramp = crops, torch.arange(crops.size, device=device)

    def epoch(self, index: int, batch: int) -> EpochOfCrops:
        """Return the crops of epoch ``index`` in batches; a smaller last batch is dropped unless it is the only one."""
        rng = np.random.default_rng([self._crops.seed, index])
        photograph = rng.permutation(np.repeat(np.arange(len(self._sizes)), self._crops.per_photograph))
        room = self._sizes[photograph] - self._crops.size + 1
        top, left = (rng.integers(room[:, axis]) for axis in (0, 1))
        width = self._sizes[photograph, 1]
        corner = self._starts[photograph] + top * width + left
        turns = rng.integers(8, size=max(1, len(photograph) // batch)) * self._crops.augment
        place = np.stack([corner, width], axis=1)
        return EpochOfCrops(self._pixels, self._ramp, torch.from_numpy(place).to(self._pixels.device), turns, batch)


@dataclass(frozen=True)
class EpochOfCrops:
    """Batches of (B, 3, crop, crop) float32 in [0, 1]; each batch is flipped and transposed as one."""

    pixels: Tensor
    ramp: Tensor
    place: Tensor
    turns: Array
    batch: int

    def __len__(self) -> int:
        return len(self.turns)

    def __getitem__(self, index: int) -> Tensor:
        if not 0 <= index < len(self):
            raise IndexError(index)
        place = self.place[index * self.batch:(index + 1) * self.batch]
        corner, width = place[:, 0, None, None], place[:, 1, None, None]
        crops = self.pixels[corner + self.ramp[:, None] * width + self.ramp]
        crops = crops.permute(0, 3, 1, 2).float() / 255
        turn = int(self.turns[index])
        axes = [axis for bit, axis in ((1, 2), (2, 3)) if turn & bit]
        crops = crops.flip(axes) if axes else crops
        return crops.transpose(2, 3) if turn & 4 else crops


def downsample(high: Tensor, scale: int, kind: str = "box", linear_light: bool = True) -> Tensor:
    """Downsample sRGB values (N, 3, H, W) -> (N, 3, H/s, W/s), by areas or antialiased bicubic, clipped to [0, 1].

    In linear light a box averages exactly as a low-resolution render does.
    """
    values = srgb_decode(high) if linear_light else high
    if kind == "box":
        low = F.avg_pool2d(values, scale)
    else:
        size = (high.shape[2] // scale, high.shape[3] // scale)
        low = F.interpolate(values, size, mode="bicubic", antialias=True).clamp(0, 1)
    return srgb_encode(low) if linear_light else low
