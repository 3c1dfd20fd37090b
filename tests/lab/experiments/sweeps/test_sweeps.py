"""The parameter sweeps."""

from __future__ import annotations

import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_lab.experiments.sweeps.sweeps import SWEEPS, choose_sweeps


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
