"""Errors against two noisy halves: they equal scikit-image's without noise, and the reference's noise cancels."""

import numpy as np
import pytest
import scipy.stats
from skimage.metrics import peak_signal_noise_ratio, structural_similarity
from tests.support.textures import GAUSSIAN, blurred, noisy, textured_image

from lfsr_core.metrics.eia_metrics import student_95
from lfsr_core.metrics.split_ssim import psnr, split_mse, split_ssim, split_ssim_map, ssim, stacked_ssim


@pytest.mark.parametrize("shape", [(96, 128), (23, 31), (600, 40)])
def test_equal_halves_give_the_ssim_of_scikit_image(shape):
    image = textured_image(*shape)
    candidate = blurred(image)
    expected = structural_similarity(candidate, image, **GAUSSIAN)
    assert expected < 0.98
    assert split_ssim(candidate, image, image) == pytest.approx(expected, abs=1e-6)
    assert ssim(candidate, image) == pytest.approx(expected, abs=1e-6)


def test_bounds_symmetry_local_ssim_and_psnr_are_scikit_images():
    image, candidate = textured_image(), blurred(textured_image())
    assert ssim(image, image) == pytest.approx(1, abs=1e-12)
    assert -1 <= ssim(candidate, image) < 1
    assert ssim(candidate, image) == pytest.approx(ssim(image, candidate), abs=1e-12)
    assert split_ssim(candidate, image, candidate) == pytest.approx(split_ssim(candidate, candidate, image), abs=1e-12)
    image = textured_image(600, 64)  # higher than one band
    _, expected = structural_similarity(blurred(image), image, full=True, **GAUSSIAN)
    np.testing.assert_allclose(split_ssim_map(blurred(image), image, image), expected, atol=1e-9)
    image, candidate = textured_image(), blurred(textured_image())
    expected = peak_signal_noise_ratio(image, candidate, data_range=1)
    assert psnr(split_mse(candidate, image, image)) == pytest.approx(expected, abs=1e-9)
    assert psnr(0.0) is None
    assert psnr(-1e-9) is None


@pytest.mark.parametrize(("noise", "tolerance"), [(0.01, 0.001), (0.02, 0.002), (0.03, 0.008), (0.04, 0.02)])
def test_noise_of_the_reference_cancels(noise, tolerance):
    """In split SSIM up to ``tolerance``, in MSE up to 0.5 %; the plain figures move ten times as far."""
    image = textured_image(192, 256)
    candidate = blurred(image)
    true_ssim, true_mse = ssim(candidate, image), split_mse(candidate, image, image)
    halves = [(noisy(image, noise, 100 + i), noisy(image, noise, 200 + i)) for i in range(6)]
    split = np.mean([split_ssim(candidate, a, b) for a, b in halves])
    squared = np.mean([split_mse(candidate, a, b) for a, b in halves])
    assert split == pytest.approx(true_ssim, abs=tolerance)
    assert squared == pytest.approx(true_mse, rel=0.005)
    plain = np.mean([ssim(candidate, (a + b) / 2) for a, b in halves])
    plain_squared = np.mean([np.mean((candidate - (a + b) / 2) ** 2) for a, b in halves])
    assert true_ssim - plain > 10 * tolerance
    assert plain_squared - true_mse == pytest.approx(noise**2 / 2, rel=0.05)


def test_a_candidate_that_shares_a_halfs_noise_is_flattered():
    """Why a candidate must not be made from its reference."""
    image = textured_image(192, 256)
    a, b = noisy(image, 0.02, 100), noisy(image, 0.02, 200)
    independent, shared = (blurred(image, 0) + 0.5 * (noisy(image, 0.02, seed) - image) for seed in (300, 100))
    assert split_ssim(shared, a, b) > split_ssim(independent, a, b) + 0.02


def test_a_correct_image_is_told_from_a_wrong_one_in_heavy_noise():
    image = textured_image(192, 256)
    a, b = noisy(image, 0.05, 5), noisy(image, 0.05, 6)
    assert ssim(image, (a + b) / 2) < 0.7
    assert split_ssim(image, a, b) > 0.9
    assert split_ssim(image, a, b) > split_ssim(blurred(image, 0.03), a, b) + 0.1


def test_stacked_images_do_not_see_each_other():
    stack = np.stack([textured_image(20, 24, seed) for seed in range(200)])  # more than one call's worth of channels
    candidates = np.stack([blurred(image) for image in stack])
    together = stacked_ssim(candidates, stack, stack)
    for index in (0, 99, 199):
        alone = split_ssim_map(candidates[index], stack[index], stack[index]).mean(-1)
        np.testing.assert_allclose(together[index], alone, atol=1e-12)


@pytest.mark.parametrize("freedom", [3, 5, 11, 40, 1000])
def test_small_samples_get_students_intervals(freedom):
    assert student_95(freedom) == pytest.approx(scipy.stats.t.ppf(0.975, freedom), rel=0.01)
