"""chart.json: a chart is read back as it was, and whatever is broken in one is named."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from lfsr_core.errors import LfsrError
from lfsr_core.records import to_data, write_record
from lfsr_lab.experiments.chart.records import read_chart
from tests.support.chart_example import example

MEASURED = Path(__file__).parents[4] / "docs" / "results" / "measured"


@pytest.mark.parametrize("name", ["small.json", "small-now.json", "eight-k.json", "eight-k-helmet.json"])
def test_charts_that_were_measured_are_still_read_and_written_as_they_were(tmp_path, name):
    chart = read_chart(MEASURED / name)
    assert lacks_nothing(to_data(chart), json.loads((MEASURED / name).read_text()))
    write_record(tmp_path / name, chart)
    assert read_chart(tmp_path / name) == chart


def lacks_nothing(read, written):
    """What an older version did not write may be there, with its default."""
    if isinstance(written, dict):
        return all(name in read and lacks_nothing(read[name], value) for name, value in written.items())
    if isinstance(written, list):
        return len(read) == len(written) and all(map(lacks_nothing, read, written))
    return read == written


BREAKS = {
    "'environment'": lambda chart: chart.pop("environment"),
    "has format 7": lambda chart: chart.update(format=7),
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
