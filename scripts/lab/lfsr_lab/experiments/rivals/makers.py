"""Methods of others: networks that make the views between low-resolution views, by name, and filters of their noise.

The views made lie in the hull of those given. LFBM5D (Alain and Smolic, MMSP 2017) filters patches in five dimensions;
its authors' program is GPL-3.0-or-later and runs as a process of its own: it is not part of this repository.
"""

from __future__ import annotations

import dataclasses
import itertools
import subprocess
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as nn
from scipy.ndimage import convolve1d
from torch import Tensor

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.images.image_files import read_png, write_png
from lfsr_lab.experiments.rivals import matlab
from lfsr_lab.experiments.rivals.matlab import state
from lfsr_lab.experiments.rivals.sheared_epi import ShearedEPI

ANGULAR_RATIO = 7
LEAK = 0.2
BAND, MARGIN = 128, 16  # rows at a time, and rows beside them that are seen too
CORNERS = np.array([0, 7, 56, 63])  # of 8×8 views, columns first as MATLAB counts
OTHERS = np.setdiff1d(np.arange(64), CORNERS)


class AngularSR:
    """The network of two alternating pairs; the weights of 4, 8 and 16 pairs are not in the stored copy."""

    def __init__(self, clones: Path) -> None:
        self._layers = matlab.parameters(clones, "LightFieldAngularSR/pretrained_models/Layer2.mat")

    def __call__(self, corners: Array) -> Array:
        """Return views (8, 8, H, W, 3) of (2, 2, H, W, 3), display values in [0, 1]."""
        colour = matlab.to_ycbcr(corners)
        share = matlab.linear(np.arange(ANGULAR_RATIO + 1)[:, None] / ANGULAR_RATIO - np.arange(2))
        dense = np.einsum("ai,bj,ijhwc->abhwc", share, share, colour)
        luma = matlab.tensor(colour[..., 0])
        bands = []
        for start in range(0, luma.shape[2], BAND):
            before = min(start, MARGIN)
            band = self.luma(luma[:, :, start - before:start + BAND + MARGIN])
            bands.append(np.asarray(band[:, :, before:before + min(BAND, luma.shape[2] - start)]))
        dense[..., 0] = np.concatenate(bands, 2)
        made = matlab.from_ycbcr(dense)
        made[::ANGULAR_RATIO, ::ANGULAR_RATIO] = corners
        return made

    @torch.inference_mode()
    def luma(self, corners: Tensor) -> Tensor:
        """Return luma (8, 8, H, W) of (2, 2, H, W)."""
        convolve, x = self._convolve, corners[:, :, None]
        features = convolve(x, "pre_level1_conv6d", (1, 1))
        for pair in (1, 2):
            features = convolve(features, f"level{pair}_conv6d", (1, 0), "_mid")
            features = convolve(features, f"level{pair}_conv6d", (0, 1), "_mid2")
        coarse = convolve(features, "level1_conv6d", (1, 0), leak=1.0)[0, 0]
        fine = convolve(_arranged(coarse, corners)[:, :, None], "pre_level1_conv6d", (1, 0), "_2", step=2)
        fine = convolve(fine, "level1_conv6d", (1, 0), "_post", step=2)
        return _arranged(coarse + convolve(fine, "level1_conv6d", (1, 0), "_post2", leak=1.0)[0, 0], corners)

    def _convolve(self, x: Tensor, name: str, pad: tuple[int, int], end: str = "", step: int = 1,
                  leak: float = LEAK) -> Tensor:
        weight = self._layers[f"{name}_f{end}"]
        weight = weight.reshape(*weight.shape, *[1] * (6 - weight.ndim))
        made = matlab.convolution_4d(x, weight, self._layers[f"{name}_b{end}"], pad, step)
        return torch.nn.functional.leaky_relu(made, leak)


def _arranged(others: Tensor, corners: Tensor) -> Tensor:
    """Return (8, 8, H, W) of 60 new views and (2, 2, H, W), whose order is columns first."""
    whole = others.new_empty(64, *others.shape[1:])
    whole[OTHERS] = others
    whole[CORNERS] = corners.transpose(0, 1).flatten(0, 1)
    return whole.reshape(8, 8, *others.shape[1:]).transpose(0, 1)


EPICNN_RATIO = 3
CROP = 4  # rows and columns that the last layer makes beyond each end
BATCH = 64  # epipolar-plane images at a time


class EPICNN:
    """The network on the rows of a light field, then on its columns."""

    def __init__(self, clones: Path) -> None:
        self._layers = matlab.cells(clones, "lfepicnn/EPICNN/EPICNN_model.mat")

    def __call__(self, views: Array) -> Array:
        """Return views (3·(m - 1) + 1, 3·(n - 1) + 1, H, W, 3) of (m, n, H, W, 3), display values in [0, 1].

        One row or column of views is tripled along the other axis alone.
        """
        down = np.stack([self._tripled(column) for column in views.swapaxes(0, 1).swapaxes(2, 3)], 1).swapaxes(2, 3)
        return np.stack([self._tripled(row) for row in down])

    def _tripled(self, views: Array) -> Array:
        """Return views (3·(n - 1) + 1, H, W, 3) of (n, H, W, 3), which differ along W."""
        if len(views) == 1:
            return views
        luma = matlab.to_ycbcr(views.astype(float)).swapaxes(0, 1)
        planes = np.pad(luma, [(0, 0), (1, 1), (0, 0), (0, 0)], mode="edge")
        made = matlab.resized(planes, 1, EPICNN_RATIO * (planes.shape[1] - 1) + 1)
        made[..., 0] = np.concatenate([self._luma(planes[start:start + BATCH, ..., 0])
                                       for start in range(0, len(planes), BATCH)])
        return matlab.from_ycbcr(made[:, EPICNN_RATIO:-EPICNN_RATIO]).swapaxes(0, 1)

    @torch.inference_mode()
    def _luma(self, planes: Array) -> Array:
        x = matlab.tensor(planes)[:, None]
        for weight, bias in self._layers[:2]:
            x = nn.relu(matlab.convolution(x, weight, bias, 2))
        weight, bias = self._layers[2]
        return np.asarray(matlab.transposed(x, weight, bias, (EPICNN_RATIO, 1))[:, 0, CROP:-CROP, CROP:-CROP])


Make = Callable[[Array], Array]  # views (m, n, H, W, 3) to (r·(m - 1) + 1, r·(n - 1) + 1, H, W, 3)


@dataclasses.dataclass(frozen=True)
class Maker:
    ratio: int | None  # steps between two given views; None for any
    load: Callable[[Path, int, int], Make]  # from the folder of clones, the ratio, and the greatest shear in pixels

    def makes(self, ratio: int) -> bool:
        """Whether it can divide the step between views by ``ratio``."""
        return self.ratio in (ratio, None)


MAKERS = {
    "AngularSR-2": Maker(ANGULAR_RATIO, lambda clones, ratio, _: lambda views: of_cells(views, ratio,
                                                                                        AngularSR(clones))),
    "Sheared-EPI": Maker(None, lambda clones, ratio, most: lambda views: of_cells(
        views, ratio, lambda corners: ShearedEPI(clones, most)(corners, ratio))),
    "EPICNN": Maker(EPICNN_RATIO, lambda clones, *_: EPICNN(clones))}


def of_cells(views: Array, ratio: int, make: Make) -> Array:
    """Return views made by a network that takes 2×2, cell by cell; those that two cells share are their means."""
    rows, columns = (ratio * (count - 1) + 1 for count in views.shape[:2])
    total = np.zeros((rows, columns, *views.shape[2:]), np.float32)
    count = np.zeros((rows, columns, 1, 1, 1), np.float32)
    for row, column in np.ndindex(views.shape[0] - 1, views.shape[1] - 1):
        part = slice(row * ratio, (row + 1) * ratio + 1), slice(column * ratio, (column + 1) * ratio + 1)
        total[part] += make(views[row:row + 2, column:column + 2])
        count[part] += 1
    return total / count


PROGRAM = "LFBM5Ddenoising"
# The settings of their own example: patches, searches and transforms of the two steps.
SETTINGS = "8 18 6 16 4 id sadct haar 0 16 18 6 8 4 dct sadct haar 0 opp 1"

DETAIL = np.array([-0.48296291, 0.8365163, -0.22414387, -0.12940952])  # high-pass filter of Daubechies' second wavelet
NORMAL = 0.67448975  # median of the absolute value of a standard normal distribution


def program(clones: Path) -> Path:
    """Return the program, compiled by its own instructions into the clone LFBM5D; LfsrError where it is missing."""
    executable = next((path for path in (clones / "LFBM5D").rglob(PROGRAM) if path.is_file()), None)
    if executable is None:
        raise LfsrError(f"{clones / 'LFBM5D'} has no program {PROGRAM}: compile it as its README says")
    return executable


def deviation(image: Array) -> float:
    """Return the deviation of the noise in (H, W), from its diagonal details (Donoho and Johnstone)."""
    details = convolve1d(convolve1d(image, DETAIL, 0, mode="reflect"), DETAIL, 1, mode="reflect")[::2, ::2]
    return float(np.median(np.abs(details[details != 0]))) / NORMAL if details.any() else 0.0


def filtered(program: Path, views: Array) -> Array:
    """Denoise views (m, n, H, W, 3), display values in [0, 1]; LfsrError where the program fails.

    The deviation of the noise is estimated, as in the repository LightField_Denoising.
    """
    sigma = np.mean([deviation(view[..., channel]) for row in views for view in row for channel in range(3)])
    with tempfile.TemporaryDirectory() as name:
        noisy, basic, clean = (Path(name) / part for part in ("noisy", "basic", "clean"))
        for folder in (noisy, basic, clean):
            folder.mkdir()
        for row, column in np.ndindex(views.shape[:2]):
            write_png(noisy / _name(row, column), np.round(views[row, column] * 255).astype(np.uint8))
        rows, columns = views.shape[:2]
        command = [str(program), "none", "SAI", "_", str(columns), str(rows), "1", "1", "1", "1", "row",
                   f"{sigma * 255:.3f}", "2.7", str(noisy), str(basic), str(clean), "none", *SETTINGS.split(),
                   str(Path(name) / "measures.txt")]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
        if ended.returncode or not (clean / _name(rows - 1, columns - 1)).exists():
            raise LfsrError(f"{program} ended with {ended.returncode} and no views "
                            f"({(ended.stderr or ended.stdout).strip()[-100:]}): check the program")
        return np.stack([np.stack([read_png(clean / _name(row, column)) for column in range(columns)])
                         for row in range(rows)]).astype(np.float32) / 255


def _name(row: int, column: int) -> str:
    return f"SAI_{row + 1:02d}_{column + 1:02d}.png"


PATCH, REACH, SIMILAR = 20, 10, 6  # pixels; of the search in each further view; patches
WEIGHTS = "LightField_Denoising/denoising_methods/LFDnPatch/weights/lfdnpatch_color_blind.pth"


class LFDnPatch:
    """The network, trained on Gaussian noise of all strengths up to 55 of 255."""

    def __init__(self, clones: Path) -> None:
        tensors = state(clones, WEIGHTS)
        names = [name.removesuffix(".weight") for name in tensors if name.endswith(".weight")]
        self._layers = [(tensors[f"{name}.weight"], tensors[f"{name}.bias"]) for name in names]

    def __call__(self, views: Array) -> Array:
        """Denoise views (m, n, H, W, 3), display values in [0, 1]."""
        whole = np.round(views * 255).astype(np.int16)
        return np.stack([np.stack([self._denoised(_seen(whole, row, column)) for column in range(views.shape[1])])
                         for row in range(views.shape[0])])

    @torch.inference_mode()
    def _denoised(self, seen: Array) -> Array:
        x = noisy = torch.tensor(seen / 255, dtype=torch.float32).permute(2, 0, 1)[None]
        for number, (weight, bias) in enumerate(self._layers):
            x = nn.conv2d(nn.relu(x) if number else x, weight, bias, padding=1)
        return np.asarray((noisy[:, -3:] - x)[0].permute(1, 2, 0).clip(0, 1))


def _seen(views: Array, row: int, column: int) -> Array:
    """Return (H, W, 21): similar patches, the best first, then the view itself."""
    own = views[row, column]
    seen = np.concatenate([own] * (SIMILAR + 1), -1)
    lines = [views[row, column + 1:], views[row, :column][::-1], views[row + 1:, column], views[:row, column][::-1]]
    for top, left in itertools.product(*(range(0, size, PATCH) for size in own.shape[:2])):
        patch = own[top:top + PATCH, left:left + PATCH]
        matches = [match for axis, line in zip((1, 1, 0, 0), lines, strict=True)
                   for match in _along(line, patch, (top, left), axis)]
        for number, (_, similar) in enumerate(sorted(matches, key=lambda match: match[0])[:SIMILAR]):
            seen[top:top + PATCH, left:left + PATCH, 3 * number:3 * number + 3] = similar
    return seen


def _along(line: Array, patch: Array, start: tuple[int, int], axis: int) -> Iterable[tuple[float, Array]]:
    """Yield the difference and the pixels of the patch's likeness in each view of a line, followed along one axis."""
    at, shape = list(start), patch.shape[:2]
    for view in line:
        most = view.shape[axis] - shape[axis]
        places = range(max(at[axis] - REACH, 0), min(at[axis] + REACH, most) + 1)
        matches = []
        for place in places:
            spot = [place if dim == axis else at[dim] for dim in (0, 1)]
            pixels = view[spot[0]:spot[0] + shape[0], spot[1]:spot[1] + shape[1]]
            matches.append((float(np.abs(pixels - patch).mean()), place, pixels))
        difference, at[axis], pixels = min(matches, key=lambda match: match[0])
        yield difference, pixels
