"""The choice of the cheapest candidate that reaches the target: properties of pure functions."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.base.errors import LfsrError
from lfsr_core.optics.depth_scale import samples_at
from lfsr_core.plan import candidates as plan
from lfsr_core.plan.candidates import Candidate, Rated, asymptote, candidates, chain, choose
from lfsr_core.plan.estimate import Estimate
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, PLAIN_METHOD
from tests.support.synthetic import MINI

SIMPLE = PLAIN_METHOD
METHODS = ("bilinear", "oidn+bilinear", "bicubic")


def rated(scale: int, spp: int, method: str, seconds: float, low: float | None, mean: float | None = None) -> Rated:
    known = None if low is None else Estimate(low + 0.01 if mean is None else mean, low, low + 0.02, 0.005, 30)
    return Rated(scale, spp, method, seconds, known)


@st.composite
def rows(draw) -> list[Rated]:
    keys = draw(st.lists(st.tuples(st.sampled_from((1, 2, 4)), st.sampled_from((4, 16, 64)), st.sampled_from(METHODS)),
                         min_size=1, max_size=12, unique=True))
    accuracy = st.one_of(st.none(), st.floats(0.8, 1.0))
    return [rated(*key, draw(st.floats(0.1, 100)), draw(accuracy)) for key in keys]


@given(rows(), st.floats(0.8, 1.0))
def test_what_is_chosen_meets_the_target_and_nothing_confirmed_is_much_cheaper(found, target):
    choice = choose(found, target)
    confirmed = [row for row in found if row.estimate is not None
                 and all(other.estimate.low >= target for other in chain(row, found)
                         if other.candidate.spp >= row.candidate.spp)]
    assert (choice.chosen is None) == (not confirmed)
    if choice.chosen is None:
        assert choice.limit
    else:
        assert choice.chosen in confirmed
        assert choice.chosen.seconds <= plan.AS_GOOD * min(row.seconds for row in confirmed)


@given(rows(), st.floats(0.8, 1.0), st.floats(0.1, 100))
def test_nothing_slower_than_the_limit_is_chosen(found, target, most):
    chosen = choose(found, target, most).chosen
    assert chosen is None or chosen.seconds <= most


def test_a_lucky_draw_at_few_samples_is_not_believed():
    found = [rated(4, 4, "bilinear", 1, 0.96), rated(4, 16, "bilinear", 2, 0.94), rated(4, 64, "bilinear", 8, 0.97)]
    assert choose(found, 0.95).chosen.candidate.spp == 64


def test_of_equally_cheap_candidates_the_simplest_is_taken():
    found = [rated(4, 16, "oidn+bilinear+epi", 10.0, 0.97), rated(4, 16, "oidn+bilinear", 10.2, 0.96),
             rated(4, 64, "bilinear", 10.4, 0.96), rated(2, 16, "bilinear", 11.0, 0.96)]
    assert choose(found, 0.95).chosen.candidate == Candidate(4, 64, "bilinear")
    assert choose(found[:2], 0.95).chosen.candidate == Candidate(4, 16, "oidn+bilinear")


@pytest.mark.parametrize(("found", "message"), [
    ([rated(4, 16, "bilinear", 1, 0.90, 0.92), rated(4, 64, "bilinear", 2, 0.93, 0.94)], "noise"),
    ([rated(4, 16, "bilinear", 1, 0.90, 0.920), rated(4, 64, "bilinear", 2, 0.91, 0.921)], "upscaling: at scale 4"),
    ([rated(1, 16, "none", 1, 0.90, 0.920), rated(1, 64, "none", 2, 0.91, 0.921)], "full resolution"),
    ([rated(4, 16, "bilinear", 1, 0.94, 0.96)], "certainty"),
])
def test_what_limits_is_said(found, message):
    choice = choose(found, 0.95)
    assert choice.chosen is None and choice.best is found[-1]
    assert message in choice.limit


def test_a_target_that_is_reached_too_late_is_limited_by_time():
    found = [rated(4, 16, "bilinear", 1, 0.90), rated(4, 64, "bilinear", 20, 0.97)]
    choice = choose(found, 0.95, most_seconds=10)
    assert choice.chosen is None and choice.limit.startswith("time:") and choice.best is found[0]


def test_gains_that_shrink_end_where_their_sum_does():
    assert asymptote([0.8, 0.9, 0.95]) == pytest.approx(1.0)
    assert asymptote([0.9]) == 0.9
    assert asymptote([0.9, 0.94]) == pytest.approx(0.98)
    assert asymptote([0.9, 0.95, 0.94]) == 0.94


@given(st.lists(st.integers(1, 4096), min_size=1, max_size=5, unique=True), st.integers(0, 5))
def test_between_lies_between(spps, steps):
    for spp, fewer, more, weight in plan.between(spps, steps):
        assert fewer < spp < more and 0 < weight < 1
        assert fewer in spps and more in spps and not any(fewer < other < more for other in spps)
    assert plan.between(spps, 0) == []


def test_between_goes_in_equal_ratios():
    assert [(spp, weight) for spp, _, _, weight in plan.between([4, 64], 3)] == [(8, 0.25), (16, 0.5), (32, 0.75)]


def test_candidates_are_all_combinations_the_display_and_methods_allow():
    found = candidates(MINI, None, (4, 16), ("bilinear", "oidn+bilinear"))
    assert {candidate.scale for candidate in found} == {1, 2, 4, 8}
    assert {candidate.method for candidate in found if candidate.scale == 1} == {"none", "oidn"}
    assert {candidate.method for candidate in found if candidate.scale == 2} == {"bilinear", "oidn+bilinear"}
    costs = [plan.samples_of(candidate, MINI) for candidate in found]
    assert costs == sorted(costs) and len(set(found)) == len(found) == 16


@given(st.sampled_from((2, 4)), st.integers(1, 4096))
def test_candidates_of_the_same_rays_cost_the_same(scale, spp):
    found = candidates(MINI, None, methods=("bilinear",), rays=(1, 4))
    assert {(each.scale, each.spp) for each in found} == {(1, 1), (1, 4), (2, 4), (2, 16), (4, 16), (4, 64), (8, 64),
                                                          (8, 256)}
    assert len({plan.samples_of(each, MINI) for each in found}) == 2
    *_, rays, _, _ = Candidate(scale, spp, "bilinear").options(MINI)
    assert samples_at(MINI, scale, float(rays)) == spp, "the command renders what was planned"


def test_a_network_is_a_candidate_only_where_it_was_trained():
    assert plan.methods_at(4, ("bilinear", "paper")) == ("bilinear", "paper")
    assert plan.methods_at(2, ("bilinear", "paper")) == ("bilinear",)
    assert plan.methods_at(1, ("bilinear", "oidn+bilinear")) == ("none", "oidn")
    with pytest.raises(LfsrError, match="no method of none works at scale 2"):
        candidates(MINI, (2,), (4,), ("none",))


def test_default_methods_hold_the_simple_one_and_the_default():
    found = plan.default_methods()
    assert found[0] == SIMPLE and DEFAULT_METHOD in found and len(set(found)) == len(found)


@pytest.mark.parametrize(("arguments", "message"), [
    (((3,), (4,), None), "scale is 3"), ((None, (0,), None), "samples per pixel is 0"),
    ((None, (4,), ("bilinar",)), "did you mean 'bilinear'")])
def test_impossible_candidates_are_refused(arguments, message):
    with pytest.raises(LfsrError, match=message):
        candidates(MINI, *arguments)
