"""Intervals over lenses of a whole reference: they cover, and neighbours that are alike widen them."""

from __future__ import annotations

import numpy as np
import pytest

from lfsr_lab.experiments.engine.intervals import BLOCK, block_interval, lens_intervals
from tests.support.synthetic import MINI, light_field

SHAPE = (15, 24)


def coverage(draw, mask, mean, draws=300):
    found = [block_interval(draw(), mask) for _ in range(draws)]
    return np.mean([abs(value - mean) <= half for value, half in found])


def test_independent_lenses_are_covered_in_95_of_100_draws():
    random = np.random.default_rng(0)
    mask = random.random(SHAPE) < 0.6
    assert coverage(lambda: random.normal(0.7, 0.2, SHAPE), mask, 0.7) == pytest.approx(0.95, abs=0.035)


def test_lenses_that_are_alike_in_blocks_are_covered_too():
    random = np.random.default_rng(1)
    small = tuple(size // BLOCK for size in SHAPE)
    mask = np.ones(SHAPE, bool)

    def draw():
        return np.kron(random.normal(0.7, 0.2, small), np.ones((BLOCK, BLOCK)))

    assert coverage(draw, mask, 0.7) == pytest.approx(0.95, abs=0.035)


def test_only_the_mask_counts():
    random = np.random.default_rng(2)
    values, mask = random.random(SHAPE), random.random(SHAPE) < 0.3
    mean, half = block_interval(values, mask)
    assert mean == pytest.approx(values[mask].mean())
    assert block_interval(np.where(mask, values, 99.0), mask) == pytest.approx((mean, half))


def test_one_block_has_no_interval():
    mask = np.zeros(SHAPE, bool)
    mask[0, 0] = True
    assert block_interval(np.ones(SHAPE), mask) == (1.0, None)


def test_an_image_whose_error_varies_has_an_interval_and_one_without_error_has_none_in_decibels():
    truth = light_field()[..., :3]
    mask = np.ones(MINI.lenses[::-1], bool)
    noisy = truth + np.random.default_rng(3).normal(0, 0.1, truth.shape).astype(np.float32).clip(0)
    found = lens_intervals(noisy, truth, truth, MINI.lenses, mask)
    assert all(0 < found[name] < limit for name, limit in (("ssim_eia_fg", 0.2), ("ssim_eia", 0.2), ("ssim_lens", 0.2),
                                                             ("ssim_lens_fg", 0.2), ("psnr_fg", 5)))
    assert lens_intervals(truth, truth, truth, MINI.lenses, mask)["psnr_fg"] is None
