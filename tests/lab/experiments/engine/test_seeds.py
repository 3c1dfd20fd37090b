"""Means over seeds and lenses: intervals hold what is true, and comparisons go by pairs."""

from __future__ import annotations

import numpy as np
import pytest

from lfsr_lab.experiments.engine.seeds import estimate, interval, replicates


@pytest.mark.parametrize(("lens_sd", "seed_sd", "rest_sd"), [(1.0, 0.0, 0.1), (0.0, 1.0, 0.1), (1.0, 1.0, 0.1)])
def test_intervals_hold_the_truth_about_as_often_as_they_say(lens_sd, seed_sd, rest_sd):
    """Whether seeds, lenses or both make the difference."""
    random, inside, runs = np.random.default_rng(7), 0, 400
    for _ in range(runs):
        values = (random.normal(0, lens_sd, (1, 20)) + random.normal(0, seed_sd, (10, 1))
                  + random.normal(0, rest_sd, (10, 20)))
        found = estimate(values)
        inside += found.low < 0 < found.high
    assert 0.87 < inside / runs < 0.99


def test_the_spread_is_that_of_the_means_of_seeds():
    values = np.array([[1.0, 3.0], [2.0, 4.0], [3.0, 5.0]])
    found = estimate(values)
    assert (found.mean, found.spread) == (3.0, pytest.approx(1.0))
    assert found.low <= 2.5 and found.high >= 3.5
    assert estimate(values[:1]).spread is None


def test_methods_with_the_same_lenses_are_compared_in_pairs():
    random = np.random.default_rng(1)
    hard = random.normal(10, 5, (1, 20))
    ours, theirs = (hard + random.normal(shift, 0.1, (10, 20)) for shift in (0.0, 1.0))
    low, high = interval(replicates(theirs) - replicates(ours))
    assert 0.8 < low < 1 < high < 1.2
