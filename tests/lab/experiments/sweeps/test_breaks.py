"""The rule for breaking, with one seed and with several."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lfsr_lab.experiments.sweeps.records import BELOW_BICUBIC, BELOW_START, Break, breaking_point

qualities = st.lists(st.floats(0, 1), min_size=1, max_size=9)


def once(figures):
    """Figures of one seed by value."""
    return {value: [figure] for value, figure in (figures.items() if isinstance(figures, dict) else enumerate(figures))}


@given(qualities, qualities)
def test_what_breaks_is_broken_and_nothing_before_it_is(values, bicubic):
    def broken(index):
        rival = bicubic[index] if index < len(bicubic) else -1
        return values[index] - rival + 1e-9 <= 0 or values[index] - values[0] + (0.05 - 1e-9) <= 0

    found = breaking_point(range(len(values)), once(values), once(bicubic))
    first = next((index for index in range(len(values)) if broken(index)), None)
    assert (found.value if found else None) == first
    assert found is None or found.earliest is found.latest is None, "one seed tells nothing of the noise"


@given(st.floats(0.06, 1))
def test_the_threshold_itself_counts_as_below_the_start_but_not_as_below_bicubic(start):
    assert breaking_point([8, 4], once({8: start, 4: start - 0.05})) == Break(4, start - 0.05, BELOW_START)
    assert breaking_point([8, 4], once({8: start, 4: start - 0.0499})) is None
    assert breaking_point([8, 4], once({8: start, 4: start}), once({8: start, 4: start})) is None
    found = breaking_point([8, 4], once({8: start, 4: start}), once({8: start, 4: start + 1e-6}))
    assert found.reason == BELOW_BICUBIC


def test_the_first_value_in_the_sweeps_order_counts_not_the_smallest():
    assert breaking_point([64, 16, 1], once({64: 0.9, 16: 0.8, 1: 0.7})).value == 16


def test_values_that_cannot_be_told_are_passed_over():
    found = breaking_point([1, 2, 3], once({1: None, 2: 0.9, 3: 0.8}), once({1: 1.0, 2: None, 3: None}))
    assert found.value == 3
    assert breaking_point([1, 2], once({1: None, 2: None})) is None
    assert breaking_point([1, 2], {}) is None


def test_noise_widens_where_a_method_may_break_and_pairs_of_seeds_cancel_it():
    noise = np.random.default_rng(1).normal(0, 0.02, (10, 4))
    bicubic = {value: list(0.8 + noise[:, value]) for value in range(4)}
    margin = {0: 0.05, 1: 0.02, 2: -0.001, 3: -0.05}
    paired = {value: list(0.8 + noise[:, value] + margin[value]) for value in range(4)}
    found = breaking_point(range(4), paired, bicubic)
    assert (found.value, found.reason, found.earliest, found.latest) == (2, BELOW_BICUBIC, 2, 2)
    alone = {value: list(np.roll(paired[value], 1)) for value in range(4)}  # the same figures, other pairs
    found = breaking_point(range(4), alone, bicubic)
    assert (found.value, found.latest) == (2, 3), "at 2 it is below on the mean, but that may be noise"


def test_a_break_that_no_value_makes_sure_has_no_end():
    noisy = {0: [0.9] * 4, 1: [0.8, 0.9, 0.8, 0.88]}
    found = breaking_point([0, 1], noisy)
    assert (found.value, found.reason, found.earliest, found.latest) == (1, BELOW_START, 1, None)
