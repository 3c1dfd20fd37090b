"""A plan's progress moves with its renders, and never back."""

from __future__ import annotations

import itertools

from lfsr_core.plan.renders import Moving


def test_a_render_moves_its_step_to_its_end():
    seen = []
    moving = Moving(lambda *state: seen.append(state))
    moving("24 lenses at scale 4, 16 samples", 0.2, 0.6)
    moving.rendering("render", 0.5, "Sample 8/16")
    moving.rendering("render", 1.0, "Finished")
    moving("a guess that was too high", 0.1, 0.3)
    assert [fraction for _, fraction, _ in seen] == [0.2, 0.4, 0.6, 0.6]
    assert seen[1] == ("plan", 0.4, "24 lenses at scale 4, 16 samples: Sample 8/16")
    assert all(before[1] <= after[1] for before, after in itertools.pairwise(seen))
