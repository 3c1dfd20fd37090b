"""Options of a plan and its candidates."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.optics.depth_scale import samples_at
from lfsr_core.optics.display import load_display
from lfsr_core.plan.options import FREE_PATHS, Candidate, PlanOptions, default_methods, methods_at
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, PLAIN_METHOD
from tests.support.synthetic import MINI
from tests.support.told import refuses


def test_a_frame_may_take_any_time_unless_it_is_limited():
    assert PlanOptions().limit == math.inf and PlanOptions(most_seconds=3).limit == 3


@pytest.mark.parametrize("wrong", [{"target": 1.0}, {"target": 0.0}, {"metric": "psnr"}, {"budget": 0.0}, {"lenses": 3},
                                   {"reference_samples": 3}, {"samples": (0,)}, {"most_seconds": 0.0}])
def test_impossible_options_are_refused(wrong):
    refuses("but", PlanOptions, **wrong)


@pytest.mark.parametrize("wrong", [{"scales": (3,)}, {"methods": ("bilinar",)}, {"rays": (0.0,)},
                                   {"scales": (2,), "methods": ("none",)}])
def test_impossible_candidates_are_refused(wrong):
    refuses("", PlanOptions(**wrong).candidates, MINI)


def test_candidates_are_all_combinations_the_display_and_methods_allow():
    found = PlanOptions(samples=(4, 16), methods=("bilinear", "oidn+bilinear")).candidates(MINI)
    assert {candidate.scale for candidate in found} == {1, 2, 4, 8}
    assert {candidate.method for candidate in found if candidate.scale == 1} == {"none", "oidn"}
    assert {candidate.method for candidate in found if candidate.scale == 2} == {"bilinear", "oidn+bilinear"}
    costs = [candidate.paths(MINI) for candidate in found]
    assert costs == sorted(costs) and len(set(found)) == len(found) == 16


@given(st.sampled_from((2, 4)), st.integers(1, 4096))
def test_candidates_of_the_same_rays_cost_the_same(scale, samples):
    found = PlanOptions(methods=("bilinear",), rays=(1, 4)).candidates(MINI)
    assert {(each.scale, each.samples) for each in found} == {(1, 1), (1, 4), (2, 4), (2, 16), (4, 16), (4, 64),
                                                              (8, 64), (8, 256)}
    assert len({each.paths(MINI) for each in found}) == 2
    assert samples_at(MINI, scale, Candidate(scale, samples, "bilinear").rays(MINI)) == samples


def test_a_method_is_a_candidate_only_where_it_works():
    assert methods_at(4, ("none", "bilinear")) == ("bilinear",)
    assert methods_at(1, ("bilinear", "oidn+bilinear")) == ("none", "oidn")


def test_default_methods_hold_the_simple_one_and_the_default():
    found = default_methods()
    assert found[0] == PLAIN_METHOD and DEFAULT_METHOD in found and len(set(found)) == len(found)


def test_small_displays_cost_no_more_than_what_is_always_allowed():
    assert PlanOptions().most_paths(load_display("mini")) == FREE_PATHS
    assert PlanOptions().most_paths(load_display("bupt-32in-8k")) > FREE_PATHS
