"""chart.json: a chart is read back as it was, and whatever is broken in one is named."""

from __future__ import annotations

import copy
import json
from pathlib import Path

import pytest

from lfsr_core.errors import LfsrError
from lfsr_core.records import to_data, write_record
from lfsr_lab.experiments.chart.records import FORMAT, chart_of, read_chart
from tests.support.chart_example import example

MEASURED = Path(__file__).parents[4] / "docs" / "results" / "measured"


@pytest.fixture(scope="module")
def data():
    return to_data(example(2))


def test_a_chart_is_read_back_as_it_was(tmp_path):
    chart = example(2)
    write_record(tmp_path / "chart.json", chart)
    assert read_chart(tmp_path / "chart.json") == chart


@pytest.mark.parametrize("name", ["small.json", "small-now.json", "eight-k.json", "eight-k-helmet.json"])
def test_charts_that_were_measured_are_still_read(name):
    data = json.loads((MEASURED / name).read_text())
    chart = read_chart(MEASURED / name)
    assert data["format"] == FORMAT and lacks_nothing(to_data(chart), data)


def lacks_nothing(read, written):
    """What an older version did not write may be there, with its default."""
    if isinstance(written, dict):
        return all(name in read and lacks_nothing(read[name], value) for name, value in written.items())
    if isinstance(written, list):
        return len(read) == len(written) and all(map(lacks_nothing, read, written))
    return read == written


BREAKS = {
    "'environment'": lambda chart: chart.pop("environment"),
    "'extra'": lambda chart: chart.update(extra=1),
    "chart has format 7": lambda chart: chart.update(format=7),
    "environment.cores is 2.5, but": lambda chart: chart["environment"].update(cores=2.5),
    "environment.cores is True, but": lambda chart: chart["environment"].update(cores=True),
    "scenes[1].p is nan, but": lambda chart: chart["scenes"][1].update(p=float("nan")),
    "scenes is None, but": lambda chart: chart.update(scenes=None),
    "scenes[0].reference is [], but": lambda chart: chart["scenes"][0].update(reference=[]),
    "scenes[0].cells[0].role is 'high', but": lambda chart: chart["scenes"][0]["cells"][0].update(role="high"),
    "'samples'": lambda chart: chart["scenes"][0]["cells"][0].pop("samples"),
    "scenes[0].cells[0].open_seconds is None, but":
        lambda chart: chart["scenes"][0]["cells"][0].update(open_seconds=None),
    "environment.versions.numpy is 1, but": lambda chart: chart["environment"]["versions"].update(numpy=1),
}


@pytest.mark.parametrize("message", BREAKS)
def test_what_is_broken_is_named(data, message):
    broken = copy.deepcopy(data)
    BREAKS[message](broken)
    with pytest.raises(LfsrError) as error:
        chart_of(broken)
    assert message in str(error.value)


@pytest.mark.parametrize("broken", [None, [], "chart"])
def test_what_is_no_object_is_no_chart(broken):
    with pytest.raises(LfsrError, match="format None"):
        chart_of(broken)
