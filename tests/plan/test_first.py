"""The first guess and the cost of a plan, before anything is measured."""

from __future__ import annotations

import numpy as np
import pytest

from lfsr_core.optics.depth_scale import MODEL
from lfsr_core.optics.display import load_display
from lfsr_core.plan.candidates import samples_of
from lfsr_core.plan.first import first_guess, most_paths
from lfsr_core.plan.options import FREE_SAMPLES, PlanOptions

DISPLAY = load_display("bupt-32in-8k")


@pytest.mark.parametrize("move", [0.0, 0.02, 0.3])
@pytest.mark.parametrize("target", [0.8, 0.9, 0.95])
def test_the_guess_is_the_cheapest_that_should_do(move, target):
    moves, options = np.full(50, move), PlanOptions(target=target)
    guess = first_guess(DISPLAY, moves, options)
    chosen = guess.candidate
    found = options.candidates(DISPLAY)
    loss = {candidate: MODEL.loss(moves, candidate.scale, candidate.spp) for candidate in found}
    cheaper = [candidate for candidate in found if samples_of(candidate, DISPLAY) < samples_of(chosen, DISPLAY)]
    assert chosen in found
    assert guess.reaches == (loss[chosen] <= 1 - target)
    if guess.reaches:
        assert all(loss[candidate] > 1 - target for candidate in cheaper)
    else:
        assert loss[chosen] == min(loss.values())


def test_deeper_scenes_and_higher_targets_cost_more():
    def cost(move, target):
        return samples_of(first_guess(DISPLAY, np.full(9, move), PlanOptions(target=target)).candidate, DISPLAY)
    assert cost(0.0, 0.9) < cost(0.3, 0.9) and cost(0.0, 0.8) < cost(0.0, 0.98)


def test_small_displays_cost_no_more_than_what_is_always_allowed():
    assert most_paths(load_display("mini"), PlanOptions()) == FREE_SAMPLES
    assert most_paths(DISPLAY, PlanOptions()) > FREE_SAMPLES
