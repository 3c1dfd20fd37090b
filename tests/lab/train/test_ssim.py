"""SSIM and errors on the training device: those that are reported, and unbiased by a reference's noise."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import torch
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from lfsr_core.metrics.split_ssim import inside_border
from lfsr_core.metrics.split_ssim import split_ssim_map as reported_ssim_map
from lfsr_lab.train.ssim import psnr, split_error_map, split_ssim_map, ssim


def test_training_ssim_is_the_one_that_is_reported():
    rng = np.random.default_rng(1)
    x, a, b = (rng.random((40, 48, 3)).astype(np.float32) for _ in range(3))
    planes = [torch.from_numpy(v.transpose(2, 0, 1))[None] for v in (x, a, b)]
    ours = split_ssim_map(*planes)[0].permute(1, 2, 0).numpy()
    assert np.abs(inside_border(ours) - inside_border(reported_ssim_map(x, a, b))).max() < 1e-4


def test_loss_of_noisy_halves_is_lowest_at_the_clean_image():
    """The gradient of the loss must not ask for sharper or softer images because the reference is noisy."""
    rng = np.random.default_rng(2)
    y, x = np.mgrid[:64, :96]
    clean = 0.5 + 0.1 * np.sin(x / 3) * np.cos(y / 4)

    def loss(image, noise):
        planes = [torch.from_numpy(v.astype(np.float32))[None, None] for v in (
            image, *(clean + rng.normal(0, noise, clean.shape) for _ in range(2)), 0.5 + 0.9 * (clean - 0.5))]
        return split_error_map(*planes).mean().item()

    for noise in (0.001, 0.05, 0.1):
        losses = {gain: np.mean([loss(0.5 + gain * (clean - 0.5), noise) for _ in range(40)])
                  for gain in (0.8, 1.0, 1.25)}
        assert losses[1.0] == min(losses.values()), noise
        assert losses[1.0] == pytest.approx(0, abs=0.02)


def test_quality_agrees_with_scikit_image():
    random = np.random.default_rng(1)
    a = cv2.GaussianBlur(random.random((50, 60, 3)), (0, 0), 2).astype(np.float64)
    b = (a + random.normal(0, 0.05, a.shape)).clip(0, 1)
    tensors = [torch.from_numpy(image).permute(2, 0, 1)[None] for image in (b, a)]
    assert float(psnr(*tensors)) == pytest.approx(peak_signal_noise_ratio(a, b, data_range=1), abs=1e-6)
    expected = structural_similarity(a, b, data_range=1, channel_axis=2, gaussian_weights=True, sigma=1.5,
                                     use_sample_covariance=False, win_size=11)
    assert float(ssim(*tensors)) == pytest.approx(expected, abs=1e-6)
