"""SSIM and PSNR on the training device are those of scikit-image."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import torch
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from lfsr_lab.train.photographs.task import psnr, ssim


def test_quality_agrees_with_scikit_image():
    random = np.random.default_rng(1)
    a = cv2.GaussianBlur(random.random((50, 60, 3)), (0, 0), 2).astype(np.float64)
    b = (a + random.normal(0, 0.05, a.shape)).clip(0, 1)
    tensors = [torch.from_numpy(image).permute(2, 0, 1)[None] for image in (b, a)]
    assert float(psnr(*tensors)) == pytest.approx(peak_signal_noise_ratio(a, b, data_range=1), abs=1e-6)
    expected = structural_similarity(a, b, data_range=1, channel_axis=2, gaussian_weights=True, sigma=1.5,
                                     use_sample_covariance=False, win_size=11)
    assert float(ssim(*tensors)) == pytest.approx(expected, abs=1e-6)
