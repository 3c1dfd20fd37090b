"""Errors of images whose bias, variance and noise are known."""

from __future__ import annotations

import numpy as np
import pytest

from lfsr_lab.experiments.engine.truth import BIAS, FLIP, MEASURES, RELATIVE, RELMSE, SMAPE, SSIM, VARIANCE, errors
from lfsr_lab.experiments.engine.truth import reference_noise as noise_of

LENSES, SIZE = 12, 24


@pytest.fixture(scope="module")
def truth():
    """Elemental images (n, py, px, 3) of waves."""
    y, x = np.mgrid[:SIZE, :SIZE] / SIZE
    return np.array([[0.4 + 0.3 * np.sin(6 * x + lens + channel) * np.cos(5 * y + lens) for channel in range(3)]
                     for lens in range(LENSES)]).transpose(0, 2, 3, 1)


def noisy(image, sigma, seed):
    return image + np.random.default_rng(seed).normal(0, sigma, image.shape)


def halves(truth, sigma):
    return noisy(truth, sigma, 100), noisy(truth, sigma, 101)


def relative(squares, truth):
    return float((squares / (truth.mean(-1, keepdims=True)**2 + RELATIVE)).mean())


@pytest.mark.parametrize("seeds", [2, 10])
@pytest.mark.parametrize(("bias", "sigma"), [(0.0, 0.1), (0.05, 0.0), (0.05, 0.1)])
def test_bias_and_variance_are_those_that_were_put_in_whatever_the_noise_of_the_reference(truth, seeds, bias, sigma):
    images = np.array([noisy(truth + bias, sigma, seed) for seed in range(seeds)])
    found = errors(images, *halves(truth, 0.02))
    one = relative(np.full(truth.shape, 1.0), truth)
    assert found[BIAS].mean() == pytest.approx(one * bias**2, abs=0.03 * one * (bias**2 + sigma**2))
    assert found[VARIANCE].mean() == pytest.approx(one * sigma**2, abs=0.03 * one * (bias**2 + sigma**2))
    assert np.allclose(found[RELMSE].mean(0), found[BIAS] + found[VARIANCE], rtol=1e-9)


def test_one_seed_has_no_parts(truth):
    assert errors(truth[None], truth, truth).keys() == {*MEASURES}


def test_a_perfect_image_has_no_error_and_a_worse_one_more(truth):
    better, worse = (errors(np.array([truth + shift]), truth, truth) for shift in (0.0, 0.1))
    for name in MEASURES:
        assert np.allclose(better[name], 0, atol=1e-6) and worse[name].min() > 1e-3, name
    assert worse[SMAPE].mean() == pytest.approx(np.mean(0.2 / (2 * truth + 0.1 + 0.01)), rel=1e-6)
    assert worse[RELMSE].mean() == pytest.approx(relative(np.full(truth.shape, 0.01), truth), rel=0.01)


def test_a_few_fireflies_do_not_count_and_many_do(truth):
    for share, counts in ((5e-4, False), (1e-2, True)):
        image = truth.copy().reshape(-1, 3)
        image[np.random.default_rng(3).choice(len(image), int(share * len(image)), replace=False)] = 1e4
        found = errors(image.reshape(1, *truth.shape), truth, truth)[RELMSE].mean()
        assert (found > 1) == counts, found


def test_pixels_are_left_out_for_all_seeds_alike(truth):
    images = np.array([truth] * 3)
    images[1, 0, 0, 0] = 1e4
    found = errors(images, truth, truth)
    assert np.allclose(found[RELMSE], 0, atol=1e-12) and np.allclose(found[VARIANCE], 0, atol=1e-12)


def test_the_noise_of_the_reference_is_the_error_of_the_mean_of_its_halves(truth):
    """Against the exact image, which only a synthetic one has."""
    a, b = halves(truth, 0.04)
    exact, told = errors(np.array([(a + b) / 2]), truth, truth), noise_of(a, b)
    for name, tolerance in ((SSIM, 0.25), (RELMSE, 0.1), (SMAPE, 0.15), (FLIP, 0.35)):
        assert told[name] == pytest.approx(exact[name].mean(), rel=tolerance), name
