"""Captured light fields: views are left out and made again, ours through `lfsr import`, and compared with the captured.

The protocol is that of the papers: luma of 8 bits, 22 pixels cut from every border, mean over the views that were made.
Ours lies at half-view places, so an even ratio cannot be imported: there its kernels are evaluated at the views.
"""

from __future__ import annotations

import dataclasses
import math
import tempfile
from pathlib import Path

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.exports.importing import find_views, import_views, read_views
from lfsr_core.images.color import srgb_decode, srgb_encode
from lfsr_core.images.image_files import write_png
from lfsr_core.metrics.eia_metrics import stacked_ssim
from lfsr_core.optics.rays import to_views
from lfsr_core.reconstruct.second_stage import finished_linear
from lfsr_core.reconstruct.upscaler import KERNELS, decode, encode
from lfsr_lab.experiments.rivals.makers import MAKERS
from lfsr_lab.experiments.rivals.matlab import to_ycbcr

VERSION = 1  # of how figures are measured
CUT = 22  # pixels
OURS = ("bilinear", "bicubic")
KERNEL_OF = {"bilinear": "linear", "bicubic": "cubic"}
FOLDERS = {"antinous": "epinet/hci_dataset/additional/antinous",
           "translucent": "LightField_Denoising/data/clean/translucent",
           "t_rex": "LightField_Denoising/data/clean/t_rex", "Amethyst": "Sheared-EPI/Training/TrainDataLF/Amethyst",}


@dataclasses.dataclass(frozen=True)
class Task:
    """Views of a light field, from a first one on, every ``ratio``-th of which is given."""

    field: str  # of FOLDERS
    given: int  # views along each axis, or along the row
    ratio: int
    first: int = 0
    shear: int = 0  # pixels between two given views, for Sheared-EPI; 0 where it is left out, as it takes long

    @property
    def made(self) -> int:
        return self.ratio * (self.given - 1) + 1

    @property
    def name(self) -> str:
        """As papers write it."""
        return f"{self.field} {self.given}→{self.made}"


# Shears: 9 as in the tests of Sheared-EPI, more where neighbouring views differ by more (antinous: up to 3.1 pixels).
TASKS = (Task("antinous", 3, 3, 1), Task("antinous", 2, 6, 1, 19), Task("antinous", 2, 7), Task("translucent", 3, 3),
         Task("translucent", 2, 6, shear=9), Task("t_rex", 2, 3), Task("Amethyst", 6, 3), Task("Amethyst", 3, 7))


@dataclasses.dataclass(frozen=True)
class Likeness:
    psnr: float  # dB, mean over views
    ssim: float  # mean over views


def read_field(clones: Path, task: Task) -> Array:
    """Return the views (m, n, H, W, 3) uint8 of a task, with those to leave out; LfsrError where they are missing."""
    files = find_views(clones / FOLDERS[task.field])
    across, down = len(files[0]), len(files)
    if task.first + task.made > across:
        raise LfsrError(f"{clones / FOLDERS[task.field]} has {across} views across, expected "
                        f"{task.first + task.made}: fetch the whole folder")
    part = slice(task.first, task.first + task.made)
    return read_views(files)[part if down > 1 else slice(0, 1), part]


def methods(task: Task, views: Array) -> list[str]:
    """Return the names of the methods that can do a task."""
    row = len(views) == 1
    able = [name for name, maker in MAKERS.items() if maker.makes(task.ratio) and (
        name == "EPICNN" or (not row and (name != "Sheared-EPI" or task.shear)))]
    return [*(OURS if task.ratio % 2 else KERNEL_OF), *able]


def made(views: Array, task: Task, name: str, clones: Path) -> Array:
    """Return the views (m, n, H, W, 3) uint8 that a method makes of those that are given."""
    given = views[::task.ratio, ::task.ratio]
    if name in MAKERS:
        shown = MAKERS[name].load(clones, task.ratio, task.shear)(given.astype(np.float32) / 255)
    elif task.ratio % 2:
        shown = _imported(given, task.ratio, name)
    else:
        kernel = KERNEL_OF[name]
        reach, weight = KERNELS[kernel]
        values = encode(srgb_decode(given.astype(np.float32) / 255))
        for axis in (0, 1):
            count = values.shape[axis]
            places = np.arange(task.ratio * (count - 1) + 1) / task.ratio
            taps = np.floor(places).astype(int)[:, None] + np.arange(1 - reach, reach + 1)
            weights = weight(places[:, None] - taps)
            matrix = np.zeros((len(places), count))
            np.add.at(matrix, (np.arange(len(places))[:, None], np.clip(taps, 0, count - 1)),
                      weights / weights.sum(1, keepdims=True))
            values = np.moveaxis(np.tensordot(matrix, values, (1, axis)), 0, axis)
        shown = srgb_encode(decode(values))
    return np.round(np.clip(shown, 0, 1) * 255).astype(np.uint8)


def _imported(given: Array, ratio: int, name: str) -> Array:
    """Return what `lfsr import --scale` and the second stage make, without the views beyond the outermost given."""
    with tempfile.TemporaryDirectory() as folder:
        source, frame = Path(folder) / "views", Path(folder) / "frame"
        source.mkdir()
        for row, column in np.ndindex(given.shape[:2]):
            write_png(source / f"view_{row:03d}_{column:03d}.png", given[row, column])
        import_views(source, frame, scale=ratio)
        views = to_views(finished_linear(frame, name), (given.shape[3], given.shape[2]))
    margin = slice(ratio // 2, -(ratio // 2))
    return srgb_encode(views[margin if len(given) > 1 else slice(None), margin])


def likeness(views: Array, task: Task, name: str, clones: Path) -> Likeness:
    """Make the views that were left out, and compare them."""
    return compared(made(views, task, name, clones), views, task.ratio)


def compared(shown: Array, views: Array, ratio: int) -> Likeness:
    """Compare the views that were left out, (m, n, H, W, 3) uint8 each."""
    left_out = [place for place in np.ndindex(views.shape[:2]) if any(index % ratio for index in place)]
    # Luma in [0, 1], rounded to 8 bits, without its borders.
    x, y = (np.stack([np.round(to_ycbcr(images[place][CUT:-CUT, CUT:-CUT] / 255)[..., 0] * 255) / 255
                      for place in left_out])[..., None] for images in (shown, views))
    psnr = [-10 * math.log10(max(float(square), 1e-10)) for square in np.mean((x - y)**2, (1, 2, 3))]
    ssim = [stacked_ssim(*(values[None].astype(np.float32) for values in (one, other, other))).mean()
            for one, other in zip(x, y, strict=True)]
    return Likeness(float(np.mean(psnr)), float(np.mean(ssim)))
