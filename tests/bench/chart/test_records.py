"""chart.json: a chart passes, and whatever is broken in it is named."""

from __future__ import annotations

import copy

import pytest

from lfsr_core.bench.chart.records import check_chart
from lfsr_core.errors import LfsrError
from tests.support.chart_example import example


@pytest.fixture(scope="module")
def chart():
    return example(2)


def test_a_chart_passes(chart):
    check_chart(chart)


BREAKS = {
    "chart lacks 'environment'": lambda chart: chart.pop("environment"),
    "chart has an unknown entry 'extra'": lambda chart: chart.update(extra=1),
    "chart has format 7": lambda chart: chart.update(format=7),
    "chart.environment.cores is '2.5', but it must be whole number":
        lambda chart: chart["environment"].update(cores=2.5),
    "chart.environment.cores is 'True'": lambda chart: chart["environment"].update(cores=True),
    "chart.scenes[1].p is 'nan', but it must be number": lambda chart: chart["scenes"][1].update(p=float("nan")),
    "chart.scenes is 'None', but it must be a list": lambda chart: chart.update(scenes=None),
    "chart.scenes[0].reference is '[]', but it must be an object":
        lambda chart: chart["scenes"][0].update(reference=[]),
    "chart.scenes[0].cells[0].role is 'high', but it must be one of":
        lambda chart: chart["scenes"][0]["cells"][0].update(role="high"),
    "chart.scenes[0].cells[0].metrics lacks 'flip'":
        lambda chart: chart["scenes"][0]["cells"][0]["metrics"].pop("flip"),
    "chart.environment.versions.numpy is '1', but it must be text":
        lambda chart: chart["environment"]["versions"].update(numpy=1),
}


@pytest.mark.parametrize("message", BREAKS)
def test_what_is_broken_is_named(chart, message):
    broken = copy.deepcopy(chart)
    BREAKS[message](broken)
    with pytest.raises(LfsrError) as error:
        check_chart(broken)
    assert message in str(error.value)


def test_null_is_allowed_only_where_something_can_be_unknown(chart):
    broken = copy.deepcopy(chart)
    broken["scenes"][0]["cells"][0]["metrics"]["ssim_views_fg"] = None
    check_chart(broken)
    broken["scenes"][0]["cells"][0]["open_seconds"] = None
    with pytest.raises(LfsrError, match="open_seconds"):
        check_chart(broken)
