"""LFBM5D (Alain and Smolic, MMSP 2017): collaborative filtering of patches in five dimensions, by the authors' program.

The program is GPL-3.0-or-later and runs as a process of its own; it is not part of this repository.
"""

from __future__ import annotations

import itertools
import subprocess
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as nn
from scipy.ndimage import convolve1d

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.images.png import read_png, write_png
from lfsr_lab.experiments.rivals.matlab import state

PROGRAM = "LFBM5Ddenoising"
# The settings of their own example: patches, searches and transforms of the two steps.
SETTINGS = "8 18 6 16 4 id sadct haar 0 16 18 6 8 4 dct sadct haar 0 opp 1"

DETAIL = np.array([-0.48296291, 0.8365163, -0.22414387, -0.12940952])  # high-pass filter of Daubechies' second wavelet
NORMAL = 0.67448975  # median of the absolute value of a standard normal distribution


def program(clones: Path) -> Path:
    """Return the program, compiled by its own instructions into the clone LFBM5D; LfsrError where it is missing."""
    found = next((path for path in (clones / "LFBM5D").rglob(PROGRAM) if path.is_file()), None)
    if found is None:
        raise LfsrError(f"{clones / 'LFBM5D'} has no program {PROGRAM}: compile it as its README says")
    return found


def deviation(image: Array) -> float:
    """Return the deviation of the noise in (H, W), from its diagonal details (Donoho and Johnstone)."""
    details = convolve1d(convolve1d(image, DETAIL, 0, mode="reflect"), DETAIL, 1, mode="reflect")[::2, ::2]
    return float(np.median(np.abs(details[details != 0]))) / NORMAL if details.any() else 0.0


def denoised(program: Path, views: Array) -> Array:
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
        found = state(clones, WEIGHTS)
        names = [name.removesuffix(".weight") for name in found if name.endswith(".weight")]
        self._layers = [(found[f"{name}.weight"], found[f"{name}.bias"]) for name in names]

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
        found = [each for axis, line in zip((1, 1, 0, 0), lines, strict=True)
                 for each in _along(line, patch, (top, left), axis)]
        for number, (_, similar) in enumerate(sorted(found, key=lambda each: each[0])[:SIMILAR]):
            seen[top:top + PATCH, left:left + PATCH, 3 * number:3 * number + 3] = similar
    return seen


def _along(line: Array, patch: Array, start: tuple[int, int], axis: int) -> Iterable[tuple[float, Array]]:
    """Yield the difference and the pixels of the patch's likeness in each view of a line, followed along one axis."""
    at, shape = list(start), patch.shape[:2]
    for view in line:
        most = view.shape[axis] - shape[axis]
        places = range(max(at[axis] - REACH, 0), min(at[axis] + REACH, most) + 1)
        found = []
        for place in places:
            spot = [place if each == axis else at[each] for each in (0, 1)]
            pixels = view[spot[0]:spot[0] + shape[0], spot[1]:spot[1] + shape[1]]
            found.append((float(np.abs(pixels - patch).mean()), place, pixels))
        difference, at[axis], pixels = min(found, key=lambda each: each[0])
        yield difference, pixels
