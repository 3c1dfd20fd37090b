"""LFDnPatch (Feith): a network that denoises a view, and sees with it the six most similar patches of other views.

Patches are searched for along the rows and columns of views, from view to view. The search is written anew: the
authors' program compares the views above and below with a wrong view.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as nn

from lfsr_core.base.arrays import Array
from lfsr_lab.experiments.rivals.weights import state

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
