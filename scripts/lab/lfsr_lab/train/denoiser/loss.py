"""Loss of denoised crops: errors of what is shown, after the interpolation that follows the denoiser."""

from __future__ import annotations

import functools

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from lfsr_core.metrics.split_ssim import SSIM_C1, SSIM_C2, SSIM_SIGMA
from lfsr_lab.networks.denoiser import hdr_decode, hdr_encode
from lfsr_lab.train.denoiser.data import Crop

SLOPE = 1.055 / 2.4  # of the sRGB curve at 1, where the logarithm goes on
ENCODED_WEIGHT = 0.5  # of the error that the network sees
LEAST_SHOWN = 0.02  # fraction of a crop
ENLARGED = 2  # times, before structure is compared
NEAR_SIGMA = 0.7  # pixels, where elemental images cannot be enlarged
TRUNCATED = 3  # standard deviations of a window


def losses(output: Tensor, crop: Crop) -> tuple[Tensor, Tensor]:
    """Return the mean absolute error and 1 - SSIM of display values where anything shows.

    ``output``: what the network makes of ``crop.inputs``, (1, 3, H, W).
    """
    made = output[(..., *crop.inside)]
    image, target = displayed(hdr_decode(made)), displayed(crop.target)
    weight = crop.shown / crop.shown.mean().clamp(min=LEAST_SHOWN)
    error = ((image - target).abs() * weight).mean()
    error = error + ENCODED_WEIGHT * ((made - hdr_encode(crop.target)).abs() * weight).mean()
    if crop.is_tiled:
        return error, _structure_of_eis(image, target, crop)
    row, column = (window(length, NEAR_SIGMA) for length in image.shape[2:])
    return error, ((1 - _ssim(image.clamp(0, 1), target.clamp(0, 1), row, column)) * weight).mean()


def displayed(linear: Tensor) -> Tensor:
    """sRGB values of scene-linear ones; logarithmic above 1, so that highlights count for every view transform."""
    low = linear.clamp(max=1)
    curve = torch.where(low <= 0.0031308, 12.92 * low, 1.055 * low.clamp(min=1e-8) ** (1 / 2.4) - 0.055)
    return curve + SLOPE * torch.log(linear.clamp(min=1))


def _structure_of_eis(image: Tensor, target: Tensor, crop: Crop) -> Tensor:
    """1 - SSIM of enlarged elemental images, each on its own, with a window as large as that of a finished EIA."""
    shown = _elemental_images(crop.shown, crop.ei).amax((1, 2, 3)) > 0
    if not shown.any():
        return image.sum() * 0
    images = _enlarged(_elemental_images(image, crop.ei)[shown], "bilinear").clamp(0, 1)
    with torch.no_grad():
        targets = _sharply_enlarged(_elemental_images(target, crop.ei)[shown]).clamp(0, 1)
    sigma = ENLARGED * SSIM_SIGMA / crop.scale
    row, column = (window(length * ENLARGED, sigma) for length in crop.ei)
    return (1 - _ssim(images, targets, row, column)).mean()


def _elemental_images(image: Tensor, ei: tuple[int, int]) -> Tensor:
    """(1, C, H, W) -> (N, C, h, w)."""
    (h, w), (_, channels, height, width) = ei, image.shape
    tiles = image.reshape(channels, height // h, h, width // w, w)
    return tiles.permute(1, 3, 0, 2, 4).reshape(-1, channels, h, w)


def _enlarged(images: Tensor, mode: str) -> Tensor:
    return functional.interpolate(images, scale_factor=ENLARGED, mode=mode, align_corners=False)


def _sharply_enlarged(images: Tensor) -> Tensor:
    """Cubic with one step of back-projection: means over its pixels are nearly ``images`` again."""
    result = _enlarged(images, "bicubic")
    return result + _enlarged(images - functional.avg_pool2d(result, ENLARGED), "bicubic")


@functools.lru_cache(maxsize=256)
def window(length: int, sigma: float) -> Tensor:
    """(length, length) matrix whose columns are Gaussian windows, reflected at the ends."""
    reach = min(length - 1, max(1, round(TRUNCATED * sigma)))
    steps = np.arange(-reach, reach + 1)
    gauss = np.exp(-0.5 * (steps / sigma) ** 2)
    places = np.arange(length)[:, None] + steps
    places = np.where(places < 0, -places - 1, np.where(places >= length, 2 * length - 1 - places, places))
    matrix = np.zeros((length, length), np.float32)
    np.add.at(matrix, (places, np.arange(length)[:, None]), gauss / gauss.sum())
    return torch.from_numpy(matrix)


def _ssim(x: Tensor, y: Tensor, row: Tensor, column: Tensor) -> Tensor:
    """Local SSIM of (N, C, H, W); ``row``, ``column``: ``window`` of H and of W."""
    maps = torch.cat([x, y, x * x, y * y, x * y], 1)
    mean_x, mean_y, xx, yy, xy = (row.T @ maps @ column).chunk(5, 1)
    variances = (xx - mean_x * mean_x).clamp(min=0) + (yy - mean_y * mean_y).clamp(min=0)
    light = (2 * mean_x * mean_y + SSIM_C1) / (mean_x * mean_x + mean_y * mean_y + SSIM_C1)
    return light * (2 * (xy - mean_x * mean_y) + SSIM_C2) / (variances + SSIM_C2)
