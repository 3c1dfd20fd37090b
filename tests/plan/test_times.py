"""The model of a frame's time, refined by renders of several sizes."""

from __future__ import annotations

import dataclasses

import pytest

from lfsr_core.plan.candidates import Candidate
from lfsr_core.plan.times import StageTime, TimeModel, path_samples
from tests.support.synthetic import MINI, frame_of


def timed(frame, setup: float, per_sample: float):
    return dataclasses.replace(frame, seconds={"render": setup + per_sample * path_samples(frame)})


def sampled_renders(setup: float, per_sample: float) -> list:
    lens_list = tuple((row, 3) for row in range(12))
    return [timed(frame_of(2, samples=samples, lens_list=lens_list), setup, per_sample) for samples in (4, 16, 64)]


def test_time_model_finds_setup_and_samples():
    quick = timed(frame_of(4, samples=4), 0.3, 2e-3)
    start = TimeModel(1.0, 0.0, 0.0, 1e-3, 0.5, 80, 0.5, {(2, "bilinear"): StageTime(0.1, 1e-4, 1e-2)})
    model = start.refined(quick, sampled_renders(0.3, 5e-3), 0.2)
    assert model.setup == pytest.approx(0.3) and model.per_sample == pytest.approx(2e-3)
    pixels = 64 * 48
    expected = 1.0 + 0.3 + 2e-3 * pixels * 16 + 1e-3 * pixels + 0.5 + 0.1 + 1e-4 * pixels * 0.5 + 1e-2 * 80
    assert model.seconds(Candidate(2, 16, "bilinear"), MINI) == pytest.approx(expected)


def test_a_world_apart_is_made_once_and_not_at_full_resolution():
    """And is no part of what a sample costs."""
    renders = [timed(frame, 0.3, 5e-3) for frame in sampled_renders(0.3, 5e-3)]
    quick = timed(frame_of(4, samples=4), 0.3, 2e-3)
    with_world = dataclasses.replace(quick, seconds={"render": quick.seconds["render"] + 7.0, "world": 7.0})
    start = TimeModel(1.0, 0.0, 0.0, 0.0, 0.0, 80)
    plain = start.refined(quick, renders, 0.2)
    apart = dataclasses.replace(start, world=7.0).refined(with_world, renders, 0.2)
    for scale, more in ((1, 0.0), (2, 7.0), (4, 7.0)):
        candidate = Candidate(scale, 16, "bilinear")
        assert apart.seconds(candidate, MINI) == pytest.approx(plain.seconds(candidate, MINI) + more)


@pytest.mark.parametrize(("quick_setup", "expected"), [(0.2, 0.2 * 5e-3), (900.0, 5e-3)])
def test_a_quick_render_that_was_all_setup_does_not_mislead(quick_setup, expected):
    quick = timed(frame_of(4, samples=4), quick_setup, 0.0)
    model = TimeModel(1.0, 0.0, 9.0, 0.0, 0.0, 80).refined(quick, sampled_renders(0.3, 5e-3), 0.2)
    assert model.per_sample == pytest.approx(expected)
