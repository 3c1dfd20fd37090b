"""What a chart concludes: fronts, times to reach an accuracy, wins and losses."""

from __future__ import annotations

import dataclasses
import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_lab.experiments.chart.analysis import (
    analyse,
    ceiling,
    curves,
    duel,
    mean_cells,
    pareto_front,
    points,
    target,
    time_to_reach,
)
from lfsr_lab.experiments.chart.records import DIRECT, LOW, Ceiling, Point
from tests.support.chart_example import measured_cell, scene_row

SECONDS = st.sampled_from([1.0, 2.0, 3.0]) | st.floats(0.01, 1e4)  # some alike: ties happen
VALUES = st.sampled_from([0.2, 0.4, 0.6]) | st.floats(-1, 1)
POINTS = st.lists(st.builds(Point, st.just(LOW), st.sampled_from("ab"), st.integers(1, 64), SECONDS, VALUES),
                  min_size=1, max_size=12)


def curve(*pairs, role=LOW, method="ours"):
    """Points of (seconds, value) at 1, 4, 16, … samples."""
    return [Point(role, method, 4**index, *pair) for index, pair in enumerate(pairs)]


def cell(role, method, samples, render, second, value, flip=0.1):
    metrics = {"ssim_eia_fg": value, "flip": flip}
    return dataclasses.replace(measured_cell(role, method, samples, render, (second,), metrics), open_seconds=1.0)


@given(POINTS)
def test_the_front_rises_and_something_on_it_is_as_fast_and_as_good_as_any_point(candidates):
    front = pareto_front(candidates)
    for before, after in itertools.pairwise(front):
        assert before.seconds < after.seconds and before.value < after.value
    for point in candidates:
        assert any(better.seconds <= point.seconds and better.value >= point.value for better in front)


@given(POINTS, VALUES, VALUES)
def test_a_higher_accuracy_never_takes_less_time(candidates, one, other):
    lower, higher = (time_to_reach(candidates, value)[0] for value in sorted((one, other)))
    assert higher is None or (lower is not None and lower <= higher * (1 + 1e-9))


@given(POINTS)
def test_the_front_is_reached_at_its_own_time(candidates):
    for point in pareto_front(candidates):
        assert time_to_reach(candidates, point.value) == (pytest.approx(point.seconds), False)


def test_time_goes_by_its_logarithm_and_past_the_curve_there_is_a_bound_or_nothing():
    assert time_to_reach(curve((1, 0.5), (100, 0.9)), 0.7)[0] == pytest.approx(10)
    below, above = (time_to_reach(curve((2, 0.5), (8, 0.9)), value) for value in (0.4, 0.91))
    assert below == (2, True) and above == (None, False)
    assert time_to_reach(curve((2, 0.8), (4, 0.7), (8, 0.9)), 0.75)[0] == 2, "what is slower and worse does not count"


def test_wins_and_losses_are_both_named():
    ours, rival, key = curve((1, 0.5), (4, 0.8)), curve((3, 0.4), (12, 0.8), (40, 0.9)), (DIRECT, "oidn")
    duels = [duel(point, ours, key) for point in rival]
    assert [(each.outcome, each.ratio, each.bound) for each in duels] == [
        ("win", pytest.approx(1 / 3), True), ("win", pytest.approx(1 / 3), False), ("loss", None, False)]
    back = [duel(point, rival, key, of_rival=True) for point in ours]
    assert [(each.method, each.outcome) for each in back] == [("oidn", "win"), ("oidn", "win")]
    assert back[1].needs_seconds == pytest.approx(12)
    lost = duel(Point(LOW, "ours", 1, 10, 0.5), curve((2, 0.6)), key, of_rival=True)
    assert lost.outcome == "loss" and lost.ratio == pytest.approx(0.2)


def test_the_target_takes_the_worst_accuracy_between_one_and_four_samples():
    rival = curve((8, 0.5), (16, 0.7), (64, 0.9), role=DIRECT, method="oidn")
    found = target(curve((1, 0.5), (5, 0.6), (6, 0.7)), rival)
    assert found.worst_ratio == pytest.approx(5 / (8 * 16) ** 0.5)
    assert not found.met
    assert target(curve((1, 0.5), (2, 0.7)), rival).stretch_met
    assert target(curve((1, 0.5), (2, 0.69)), rival).worst_ratio is None
    assert target(curve((1, 0.5)), rival[2:]) is None


def test_less_flip_is_better_and_the_ceiling_is_no_point():
    cells = [cell(LOW, "ours", 1, 1, 1, 0.5, flip=0.2), cell(LOW, "ours", 4, 2, 1, 0.7, flip=0.1),
             cell(DIRECT, "oidn", 1, 4, 1, 0.6, flip=0.05), cell("ceiling", "ours", 4096, 900, 1, 0.95, flip=0.01),
             cell("ceiling", "bicubic", 4096, 900, 1, 0.9, flip=0.02)]
    assert ceiling(cells, "flip") == Ceiling("ours", 4096, 0.01)
    found = analyse(cells, "ours", "flip")
    assert [point.samples for point in found.front] == [1, 4, 1]
    assert [duel.outcome for duel in found.versus] == ["loss"]
    assert [duel.outcome for duel in analyse(cells, "ours").versus] == ["win"]


def test_opening_the_scene_counts_only_where_it_is_asked_for():
    cells = [cell(LOW, "ours", 1, 0.5, 0.5, 0.6), cell(DIRECT, "oidn", 1, 3, 1, 0.6)]
    found = analyse(cells, "ours")
    assert found.target.worst_ratio == pytest.approx(1 / 4)
    assert found.target_with_opening.worst_ratio == pytest.approx(2 / 5)


def test_means_are_over_what_every_scene_has():
    scenes = [scene_row("a", (cell(LOW, "ours", 1, seconds - 1, 1, value), cell(LOW, "only", samples, 1, 1, 0.1)))
              for seconds, value, samples in ((2, 0.4, 1), (8, 0.6, 4))]
    (_, points_of), = curves(points(mean_cells(scenes), "ssim_eia_fg")).items()
    assert points_of == [Point(LOW, "ours", 1, pytest.approx(4), pytest.approx(0.5))]
