"""Estimates from sampled lenses: coverage on skewed populations, strata, regression, a census."""

from __future__ import annotations

import numpy as np
import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.plan.estimate import Stratum, estimate

DRAWS = 600


def skewed(count: int, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Accuracies near 1 with a tail of bad lenses, and a covariate that explains most of it."""
    covariate = random.random(count)
    return 1 - 0.15 * covariate**3 - 0.02 * random.exponential(1, count), covariate


def stratum(values: np.ndarray, chosen: np.ndarray, inside: np.ndarray | None = None) -> Stratum:
    inside = np.ones(len(values), bool) if inside is None else inside
    return Stratum(len(values), values[chosen], inside[chosen])


def test_lower_bound_lies_below_the_truth_in_95_of_100_draws():
    random = np.random.default_rng(0)
    values, covariate = skewed(1000, random)
    covered = {False: 0, True: 0}
    for _ in range(DRAWS):
        chosen = random.choice(1000, 24, replace=False)
        for known in covered:
            x = (covariate[chosen, None], np.array([covariate.mean()])) if known else ()
            part = Stratum(1000, values[chosen], np.ones(24, bool), *x)
            covered[known] += estimate([part]).low <= values.mean()
    for known, count in covered.items():
        assert count / DRAWS > 0.92, known


def test_regression_narrows_the_interval_and_keeps_the_mean_right():
    random = np.random.default_rng(1)
    values, covariate = skewed(1000, random)
    plain, adjusted = [], []
    for _ in range(DRAWS):
        chosen = random.choice(1000, 30, replace=False)
        plain.append(estimate([stratum(values, chosen)]))
        adjusted.append(estimate([Stratum(1000, values[chosen], np.ones(30, bool), covariate[chosen, None],
                                          np.array([covariate.mean()]))]))
    assert np.mean([e.error for e in adjusted]) < 0.7 * np.mean([e.error for e in plain])
    assert np.mean([e.mean for e in adjusted]) == pytest.approx(values.mean(), abs=0.002)


def test_strata_with_lenses_that_do_not_count():
    random = np.random.default_rng(2)
    core, edge = 0.9 + 0.05 * random.random(300), 0.7 + 0.2 * random.random(80)
    hit = random.random(80) < 0.4
    truth = np.concatenate([core, edge[hit]]).mean()
    found = []
    for _ in range(DRAWS):
        parts = [stratum(core, random.choice(300, 24, replace=False)),
                 stratum(edge, random.choice(80, 8, replace=False), hit)]
        found.append(estimate(parts))
    assert np.mean([e.mean for e in found]) == pytest.approx(truth, abs=0.002)
    assert np.mean([e.low <= truth for e in found]) > 0.915  # 8 lenses of the edge: few to know their spread from


def test_a_census_is_certain():
    values = np.linspace(0.8, 1, 20)
    found = estimate([stratum(values, np.arange(20))])
    assert found.low == found.mean == found.high == pytest.approx(0.9)


def test_a_wider_spread_gives_a_lower_bound():
    random = np.random.default_rng(3)
    noise = random.normal(0, 1, 20)
    bounds = [estimate([Stratum(500, 0.9 + spread * noise, np.ones(20, bool))]) for spread in (0.001, 0.01, 0.05)]
    assert bounds[0].low > bounds[1].low > bounds[2].low


def test_a_useless_covariate_is_left_out():
    values = np.linspace(0.8, 1, 20)
    with_it = estimate([Stratum(500, values, np.ones(20, bool), np.full((20, 1), 0.3), np.array([0.9]))])
    assert with_it == estimate([Stratum(500, values, np.ones(20, bool))])


def test_what_tells_nothing_is_refused():
    with pytest.raises(LfsrError, match="no sampled lens"):
        estimate([Stratum(10, np.ones(4), np.zeros(4, bool))])
    with pytest.raises(LfsrError, match="1 sampled lens represents 10"):
        estimate([Stratum(10, np.ones(1), np.ones(1, bool))])
