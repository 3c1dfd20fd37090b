import sys

import numpy as np
import pytest
from prerequisites import needs_bpy

from lfsr_core import oidn
from lfsr_core.denoise import denoise_eia, denoise_low_resolution
from lfsr_core.errors import LfsrError
from lfsr_core.upscale import LowResEIA

RANDOM = np.random.default_rng(0)


def noisy_card(noise=0.5):
    """A card of eight bright stripes, (64, 96, 3), and the same with Monte Carlo-like noise."""
    clean = np.full((64, 96, 3), 0.1, np.float32)
    clean[:, (np.arange(96) // 12) % 2 == 1] = [3.0, 0.6, 0.2]
    return clean, np.maximum(clean * RANDOM.gamma(1 / noise**2, noise**2, clean.shape), 0).astype(np.float32)


def error(image, clean):
    return float(np.mean(((image - clean) / (clean + 0.1)) ** 2))


def test_noise_goes_and_brightness_stays():
    clean, noisy = noisy_card()
    denoised = denoise_eia(noisy)
    assert denoised.shape == noisy.shape and denoised.dtype == np.float32 and denoised.min() >= 0
    assert error(denoised, clean) < error(noisy, clean) / 5
    assert denoised.mean() == pytest.approx(clean.mean(), rel=0.1)
    assert denoised.max() > 2, "values above 1 must survive"


def test_albedo_and_normal_help():
    clean, noisy = noisy_card(noise=1.5)
    albedo = np.clip(clean / 3, 0, 1)
    normal = np.zeros_like(clean) + np.float32([0, 0, 1])
    assert error(denoise_eia(noisy, albedo, normal), clean) < 0.8 * error(denoise_eia(noisy), clean)


def test_normal_without_albedo_is_left_out():
    _, noisy = noisy_card()
    np.testing.assert_array_equal(denoise_eia(noisy, normal=np.ones_like(noisy)), denoise_eia(noisy))


def test_low_resolution_eia_is_denoised_as_one_image():
    clean, noisy = noisy_card()
    color = noisy.reshape(8, 8, 12, 8, 3).swapaxes(1, 2)
    albedo = np.clip(clean / 3, 0, 1).reshape(8, 8, 12, 8, 3).swapaxes(1, 2)
    low = LowResEIA(color, np.ones((*color.shape[:-1], 1), np.float32), {"albedo": albedo}, 16, 4)
    denoised = denoise_low_resolution(low)
    expected = denoise_eia(noisy, np.clip(clean / 3, 0, 1))
    np.testing.assert_allclose(denoised.color.swapaxes(1, 2).reshape(noisy.shape), expected, atol=1e-5)
    assert denoised.aux["noisy"] is low.color and denoised.aux["albedo"] is albedo and denoised.scale == 4


@needs_bpy
def test_library_of_blender_gives_the_same_image(monkeypatch):
    clean, noisy = noisy_card()
    albedo, normal = np.clip(clean / 3, 0, 1), np.zeros_like(clean) + np.float32([0, 0, 1])
    expected = denoise_eia(noisy), denoise_eia(noisy, albedo, normal)
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    for found, wanted in zip((denoise_eia(noisy), denoise_eia(noisy, albedo, normal)), expected, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-3, atol=1e-4)


def test_missing_library_is_one_clear_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    monkeypatch.setattr(oidn, "find_library", lambda: None)
    with pytest.raises(LfsrError, match="install the package pyoidn"):
        denoise_eia(np.zeros((4, 4, 3), np.float32))
