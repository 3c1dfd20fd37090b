"""Bands: one render where that is soon done, else parts of about a minute, whatever a row costs."""

from __future__ import annotations

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.pipeline.pace import Pace, is_worth_storing, seconds_per_part
from lfsr_core.pipeline.parts import Part

images = st.builds(Pace, width=st.integers(4, 16384), rows=st.integers(4, 16384), samples=st.integers(1, 10**5),
                   seconds=st.just(60.0))


@given(images)
def test_the_trial_is_a_small_share_inside_the_image(pace):
    trial = pace.trial
    assert 0 <= trial.first < trial.last <= pace.rows
    assert trial.size <= max(1, pace.rows / 64)


@given(images, st.floats(1e-6, 1e4))
def test_bands_end_in_time_where_every_row_costs_the_same(pace, row_seconds):
    band = pace.trial
    for _ in range(12):
        size = pace.after(dataclasses.replace(band, seconds=band.size * row_seconds))
        assert 1 <= size <= pace.most
        assert size == 1 or size * row_seconds <= pace.seconds * 1.001
        band = Part(0, size)
    assert size == min(pace.most, max(1, int(pace.seconds / row_seconds + 1e-6))) or size * row_seconds > 50


@given(images, st.integers(1, 16384))
def test_a_band_that_takes_too_long_is_followed_by_a_smaller_one(pace, size):
    assert 1 <= pace.after_timeout(Part(0, size)) <= max(1, size / 16)


def test_default_renders_stay_one_where_a_minute_will_do():
    small = Pace(480, 270, 16, 60.0)
    assert small.is_short
    usual = Pace(1920, 1080, 16, 60.0)
    assert not usual.is_short
    assert usual.takes_one(dataclasses.replace(usual.trial, seconds=23 / 64))
    assert not usual.takes_one(dataclasses.replace(usual.trial, seconds=3.0))
    assert not Pace(7680, 4320, 1, 60.0).takes_one(Part(0, 1, 0.0)), "it would not fit into one tile"


@pytest.mark.parametrize(("value", "seconds"), [("0.5", 0.5), ("-1", 0.01), ("soon", 60.0), ("inf", 86400.0)])
def test_the_environment_may_say_how_long_a_part_takes(monkeypatch, value, seconds):
    monkeypatch.setenv("LFSR_SECONDS_PER_PART", value)
    assert seconds_per_part() == seconds
    assert is_worth_storing(seconds) and not is_worth_storing(seconds / 100)
