"""Comparators scored on rendered light fields."""

from __future__ import annotations

import json

import numpy as np
import pytest
import torch
from torch import nn

from lfsr_core.errors import LfsrError
from lfsr_lab.train.lightfields.validation import SceneValidation

CPU = torch.device("cpu")
SX, SY, SIDE, SCALE = 6, 5, 4, 2


def write_scene(path, noise=0.02, seed=0):  # within what docs/reference/metrics.md asks of a reference
    """A smooth light field whose right half is background, with noisy halves and noisy low-resolution renders."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[:SY * SIDE * SCALE, :SX * SIDE * SCALE] / 20.0
    high = np.stack([0.4 + 0.2 * np.sin(x + y), 0.4 + 0.2 * np.cos(x), 0.3 + 0.1 * np.sin(y)], -1)
    low = high.reshape(SY * SIDE, SCALE, SX * SIDE, SCALE, 3).mean((1, 3))
    alpha = np.zeros((*low.shape[:2], 1))
    alpha[:, :SX * SIDE // 2] = 1
    layers = np.concatenate([low + random.normal(0, 0.2, low.shape), alpha, np.zeros((*low.shape[:2], 6))], -1)
    halves = [high + random.normal(0, noise, high.shape) for _ in range(2)]
    meta = json.dumps({"spps": [16], "lenses": [SX, SY]})
    clean = low.astype(np.float16)
    np.savez(path, meta=meta, lr_16=layers.astype(np.float16), oidn_16=clean, guided_16=clean,
             ref_a=halves[0].astype(np.float16), ref_b=halves[1].astype(np.float16))


def test_clean_input_scores_high_and_noisy_input_low(tmp_path):
    write_scene(tmp_path / "a.npz")
    upscale = nn.Upsample(scale_factor=SCALE, mode="bicubic")
    figures = SceneValidation(tmp_path, SCALE, CPU).figures(upscale)
    assert figures["scenes.ssim_oidn16"] > 0.95 > figures["scenes.ssim_raw16"] + 0.3
    assert figures["scenes.psnr_oidn16"] > figures["scenes.psnr_raw16"] + 10


def test_background_does_not_count(tmp_path):
    write_scene(tmp_path / "a.npz")

    class RightHalfBlack(nn.Module):
        """Destroys the EIs of the background only."""

        def forward(self, low):
            high = nn.functional.interpolate(low, scale_factor=SCALE, mode="bicubic").clone()
            high.view(SY, SX, *high.shape[1:])[:, SX // 2 + 1:] = 0
            return high

    scenes = SceneValidation(tmp_path, SCALE, CPU)
    assert scenes.figures(RightHalfBlack())["scenes.ssim_oidn16"] > 0.95


def test_scenes_of_another_scale(tmp_path):
    write_scene(tmp_path / "a.npz")
    with pytest.raises(LfsrError, match="scene a .* has scale 2, expected 4"):
        SceneValidation(tmp_path, 4, CPU)


def test_no_scenes(tmp_path):
    with pytest.raises(LfsrError, match="holds no training scenes"):
        SceneValidation(tmp_path, 4, CPU)
