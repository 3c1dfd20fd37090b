"""Times to equal error: exact on power laws, never too short, with intervals that hold the truth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_lab.experiments.chart.analysis import (
    DIRECT,
    LOW,
    Cost,
    Measured,
    Point,
    SceneRow,
    Times,
    UsedReference,
    drawn_seconds,
    duels,
    geometric_mean,
    mean_cells,
    mean_duels,
    reach,
    reaches,
)
from lfsr_lab.experiments.engine.truth import MEASURES, SSIM

SAMPLES = (1, 4, 16, 64)
COSTS = np.array(SAMPLES, float)[:, None]


def column(values):
    return np.array(values, float)[:, None]


@pytest.mark.parametrize("target", [0.9, 0.5, 0.3, 0.125])
def test_the_cost_on_a_power_law_is_exact(target):
    found, bound = reach(COSTS, COSTS**-0.5, np.array([target]))
    assert found[0] == pytest.approx(target**-2) and not bound[0]


def test_what_is_never_reached_is_infinite_and_what_is_reached_at_once_is_a_bound():
    found, bound = reach(COSTS, np.tile(COSTS**-0.5, 3), np.array([0.01, 1.0, 2.0]))
    assert found.tolist() == [np.inf, 1.0, 1.0] and bound.tolist() == [False, False, True]


def test_a_dearer_point_that_is_worse_does_not_count():
    found, _ = reach(COSTS, column([0.5, 0.8, 0.4, 0.2]), np.array([0.6]))
    assert found[0] == 1.0
    assert 4 < reach(COSTS, column([0.5, 0.8, 0.4, 0.2]), np.array([0.45]))[0][0] < 16


def test_a_point_that_costs_more_than_one_with_less_error_costs_no_more():
    """As measured times do on a busy machine."""
    assert reach(column([2.0, 1.0, 4.0]), column([0.5, 0.25, 0.1]), np.array([0.5]))[0][0] == 1.0
    assert reach(column([2.0, 1.0, 4.0]), column([0.5, 0.25, 0.1]), np.array([0.3]))[0][0] == 1.0


@given(st.lists(st.floats(1e-4, 1), min_size=4, max_size=4), st.floats(1e-4, 1), st.floats(0.5, 1))
def test_less_error_never_costs_less(errors, target, part):
    both = reach(COSTS, np.tile(column(errors), 2), np.array([target, part * target]))[0]
    assert both[0] <= both[1] * (1 + 1e-12)


def test_an_error_below_nothing_is_reached_like_the_least_there_is():
    """Split errors of nearly perfect images can come out negative."""
    found, _ = reach(COSTS, column([0.5, 0.1, 0.01, -0.001]), np.array([-0.002]))
    assert found[0] == pytest.approx(64)


def points(method, scale, factor, random=None, role=LOW, samples=SAMPLES, lenses=20, seeds=10):
    """A method whose error is factor / √rays, on lenses that are hard or easy for all alike."""
    hard = np.exp(np.random.default_rng(5).normal(0, 0.5, lenses))
    found = []
    for count in samples:
        noise = random.normal(1, 0.1, (seeds, lenses)) if random else np.ones((seeds, lenses))
        rows = tuple(map(tuple, (factor * (count / scale**2)**-0.5 * hard * noise).tolist()))
        times = Times((0.2 + count / scale**2,), (0.1,), None)
        found.append(Point.of(role, method, scale, count, Measured(dict.fromkeys(MEASURES, rows)), times,
                              np.arange(lenses)))
    return found


def test_a_duel_of_power_laws_has_the_ratio_of_their_squares():
    found = duels(points("ours", 4, 1.0) + points("theirs", 1, 2.0, role=DIRECT, samples=(1,)), (LOW, "ours"))
    assert len(found) == len(MEASURES)
    duel = found[0]
    assert (duel.role, duel.method, duel.samples) == (DIRECT, "theirs", 1)
    assert duel.rays.value == pytest.approx(0.25, rel=1e-4) and not duel.rays.bound
    assert duel.seconds.value == pytest.approx((0.3 + 0.25) / 1.3, rel=0.1)


def test_intervals_of_the_ratio_hold_the_truth_about_as_often_as_they_say():
    random, inside, runs = np.random.default_rng(3), 0, 60
    for _ in range(runs):
        every = points("ours", 4, 1.0, random) + points("theirs", 1, 2.0, random, DIRECT, (1,))
        rays = next(each.rays for each in duels(every, (LOW, "ours")) if each.measure == SSIM)
        inside += rays.low < 0.25 < rays.high
    assert inside / runs > 0.85 and rays.high - rays.low < 0.05


def test_a_fixed_error_is_reached_or_never():
    found = {(each.method, each.measure): each for each in reaches(points("ours", 4, 1.0) + points("worse", 4, 9.0),
                                                                   {SSIM: 0.75})}
    hard = np.exp(np.random.default_rng(5).normal(0, 0.5, 20)).mean()
    assert found["ours", SSIM].rays.value == pytest.approx((hard / 0.75)**2, rel=1e-4)
    assert found["worse", SSIM].rays.value is None


def scene(every):
    reference = UsedReference(1024, None, 20, 1.0, {})
    return SceneRow("a", "5.0", reference, tuple(each.cell for each in every), tuple(duels(every, (LOW, "ours"))), ())


def test_the_geometric_mean_has_an_interval_over_scenes():
    sharp = [Cost(ratio, ratio, ratio, False) for ratio in (0.1, 0.2, 0.4, 0.8)]
    found = geometric_mean(sharp)
    assert found.value == pytest.approx((0.1 * 0.2 * 0.4 * 0.8)**0.25, rel=1e-4)
    assert 0.1 <= found.low < 0.2 and 0.4 < found.high <= 0.8
    wide = geometric_mean([Cost(each.value, each.value / 2, each.value * 2, False) for each in sharp])
    assert wide.value == found.value and wide.low < found.low and wide.high > found.high
    assert geometric_mean([*sharp, Cost(0.3, 0.2, None, True)]).high is None
    assert geometric_mean([]).value is None and geometric_mean(sharp[:1]) == sharp[0]


def test_the_mean_duel_is_over_the_scenes_in_which_ours_gets_there():
    scenes = [scene(points("ours", 4, factor) + points("theirs", 1, 2.0, role=DIRECT, samples=(1,)))
              for factor in (1.0, 0.5, 50.0)]
    duel = mean_duels(scenes)[0]
    assert duel.scenes == 2 and duel.rays.value == pytest.approx((0.25 * 0.0625)**0.5, rel=1e-4)
    assert duel.seconds.value is not None


def test_means_over_scenes_are_of_the_cells_that_all_have():
    first, second = scene(points("ours", 4, 1.0)), scene(points("ours", 4, 3.0, samples=SAMPLES[:2]))
    found, one = mean_cells([first, second]), first.cells[0]
    assert [cell.samples for cell in found] == [1, 4]
    assert found[0].errors[SSIM].mean == pytest.approx(2 * one.errors[SSIM].mean, rel=1e-4)
    half = one.errors[SSIM].high - one.errors[SSIM].mean
    assert found[0].errors[SSIM].high - found[0].errors[SSIM].mean == pytest.approx(half * 10**0.5 / 2, rel=1e-3)
    assert found[0].seconds.mean == pytest.approx(one.seconds.mean, rel=1e-4)


def test_repeated_times_are_drawn_anew():
    drawn = drawn_seconds(Times((1.0, 2.0, 9.0), (0.5,), None))
    assert drawn[0] == 2.5 and set(np.unique(drawn)) == {1.5, 2.5, 9.5}
