"""Options of a plan."""

from __future__ import annotations

import math

import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.plan.options import PlanOptions


def test_a_frame_may_take_any_time_unless_it_is_limited():
    assert PlanOptions().limit == math.inf and PlanOptions(most_seconds=3).limit == 3


@pytest.mark.parametrize("wrong", [{"target": 1.0}, {"target": 0.0}, {"metric": "psnr"}, {"budget": 0.0}, {"lenses": 3},
                                   {"reference_spp": 3}, {"between": -1}, {"most_seconds": 0.0}])
def test_impossible_options_are_refused(wrong):
    with pytest.raises(LfsrError, match="but"):
        PlanOptions(**wrong)
