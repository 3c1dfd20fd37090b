"""The parameter sweeps and its rule for breaking."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.errors import LfsrError
from lfsr_lab.experiments.sweeps.sweeps import SWEEPS, Break, breaking_point, choose_sweeps

qualities = st.lists(st.floats(0, 1), min_size=1, max_size=9)


def along(values):
    return dict(enumerate(values))


@given(qualities, qualities)
def test_what_breaks_is_broken_and_nothing_before_it_is(values, bicubic):
    bicubic = along(bicubic)

    def broken(index):
        return bicubic.get(index, -1) > values[index] + 1e-9 or values[index] <= values[0] - 0.05 + 1e-9

    found = breaking_point(range(len(values)), along(values), bicubic)
    first = next((index for index in range(len(values)) if broken(index)), None)
    assert (found.value if found else None) == first


@given(st.floats(0.06, 1))
def test_the_threshold_itself_counts_as_below_the_start_but_not_as_below_bicubic(start):
    assert breaking_point([8, 4], {8: start, 4: start - 0.05}) == Break(4, start - 0.05, "below its start")
    assert breaking_point([8, 4], {8: start, 4: start - 0.0499}) is None
    assert breaking_point([8, 4], {8: start, 4: start}, {8: start, 4: start}) is None
    assert breaking_point([8, 4], {8: start, 4: start}, {8: start, 4: start + 1e-6}).reason == "below bicubic"


def test_the_first_value_in_the_sweeps_order_counts_not_the_smallest():
    assert breaking_point([64, 16, 1], {64: 0.9, 16: 0.8, 1: 0.7}).value == 16


def test_values_that_cannot_be_told_are_passed_over():
    assert breaking_point([1, 2, 3], {1: None, 2: 0.9, 3: 0.8}, {1: 1.0, 2: None, 3: None}).value == 3
    assert breaking_point([1, 2], {1: None, 2: None}) is None
    assert breaking_point([1, 2], {}) is None


def test_every_sweep_is_whole():
    assert len({sweep.name for sweep in SWEEPS}) == len(SWEEPS)
    for sweep in SWEEPS:
        assert set(sweep.quick) <= set(sweep.values) and len(set(sweep.values)) == len(sweep.values) > 2
        assert list(sweep.quick) == [value for value in sweep.values if value in sweep.quick]
        assert sweep.values[0] == sweep.quick[0], "both start alike"
        ordered = sorted(sweep.values)
        assert list(sweep.values) in (ordered, ordered[::-1]), "one direction from easy to hard"


def test_only_values_of_samples_share_a_scene():
    names = [sweep.scene_name(value) for sweep in SWEEPS for value in sweep.values]
    assert len(set(names)) == len(names) - 6
    assert choose_sweeps(["samples"])[0].samples(4) == 4 and choose_sweeps(["wire"])[0].samples(0.25) == 16


def test_sweeps_are_chosen_in_the_suites_order():
    assert [sweep.name for sweep in choose_sweeps(["wire", "samples"])] == ["samples", "wire"]
    assert choose_sweeps(None) == SWEEPS
    with pytest.raises(LfsrError, match="did you mean 'wire'"):
        choose_sweeps(["wires"])
