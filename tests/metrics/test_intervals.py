"""Quantiles of Student's t."""

import pytest
import scipy.stats

from lfsr_core.metrics.intervals import NORMAL_ONE_SIDED, student, student_95


@pytest.mark.parametrize("freedom", [3, 5, 11, 40, 1000])
def test_small_samples_get_students_intervals(freedom):
    assert student_95(freedom) == pytest.approx(scipy.stats.t.ppf(0.975, freedom), rel=0.01)


@pytest.mark.parametrize("freedom", [2, 3, 10, 30, 1e6])
def test_one_sided_quantiles(freedom):
    assert student(NORMAL_ONE_SIDED, freedom) == pytest.approx(scipy.stats.t.ppf(0.95, freedom), rel=0.02)
