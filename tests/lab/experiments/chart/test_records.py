"""chart.json: a chart is read back as it was, and whatever is broken in one is named."""

from __future__ import annotations

import json

import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.records import to_data, write_record
from lfsr_lab.experiments.chart.analysis import read_chart
from tests.support.chart_example import example


def test_a_chart_is_read_back_as_it_was(tmp_path):
    chart = example(2)
    write_record(tmp_path / "chart.json", chart)
    assert read_chart(tmp_path / "chart.json") == chart


BREAKS = {
    "'environment'": lambda chart: chart.pop("environment"),
    "has format 1": lambda chart: chart.update(format=1),
    "scenes[0].cells[0].role is 'high', but": lambda chart: chart["scenes"][0]["cells"][0].update(role="high"),
}


@pytest.mark.parametrize("message", BREAKS)
def test_what_is_broken_is_named(tmp_path, message):
    broken, path = to_data(example(2)), tmp_path / "chart.json"
    BREAKS[message](broken)
    path.write_text(json.dumps(broken))
    with pytest.raises(LfsrError) as error:
        read_chart(path)
    assert message in str(error.value)


def test_what_is_no_object_is_no_chart(tmp_path):
    path = tmp_path / "chart.json"
    path.write_text("[]")
    with pytest.raises(LfsrError, match="format None"):
        read_chart(path)
