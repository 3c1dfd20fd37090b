"""Tables, and pages: whole, self-contained, and nothing in them is taken for markup."""

from __future__ import annotations

import dataclasses
import json
import re

import pytest
from jinja2 import DictLoader, UndefinedError

from lfsr_core.base.errors import LfsrError
from lfsr_lab.experiments.engine import report
from lfsr_lab.experiments.engine.report import markdown_table, number

TABLE = """{% extends "base.html" %}{% import "macros.html" as macros %}{% block title %}T{% endblock %}
{% block body %}{{ macros.table(["name", "n"], rows) }}{{ picture }}{% endblock %}"""


@pytest.fixture
def templates(monkeypatch):
    """The package's templates and one of this test."""
    from jinja2 import ChoiceLoader

    environment = report._templates()
    both = ChoiceLoader([DictLoader({"test.html": TABLE}), environment.loader])
    monkeypatch.setattr(environment, "loader", both)


@dataclasses.dataclass(frozen=True)
class Results:
    """What was measured."""

    value: float


def test_results_are_written_before_anything_is_drawn(tmp_path):
    def draw():
        raise ValueError("no such font\nin this place")

    with pytest.raises(LfsrError, match=r"results.svg cannot be drawn \(no such font in this place\): .*results.json"):
        report.write_report(tmp_path, "results", Results(0.5), {".md": lambda: "# Results\n", ".svg": draw})
    assert json.loads((tmp_path / "results.json").read_text()) == {"value": 0.5}
    assert (tmp_path / "results.md").read_text() == "# Results\n" and len(list(tmp_path.iterdir())) == 2


def test_text_is_escaped_and_pictures_are_not(templates):
    svg = report.inline_svg('<?xml version="1.0"?>\n<!DOCTYPE svg>\n<svg><title>t</title></svg>', 'a & b')
    html = report.page_html("test.html", rows=[["<b>", 1]], picture=svg)
    assert '<td class="l">&lt;b&gt;</td><td>1</td>' in html
    assert '<svg role="img" aria-label="a &amp; b"><title>t</title></svg>' in html
    assert html.startswith("<!doctype html>") and "<?xml" not in html
    assert not re.search(r"<script|<link|url\(|@import", html)


def test_a_value_that_the_template_wants_must_be_given(templates):
    with pytest.raises(UndefinedError, match="picture"):
        report.page_html("test.html", rows=[])


def test_cells_are_written_by_what_they_are():
    assert markdown_table(["name", "value"], [["a", 0.12345], [1, None], [True, False]]) == [
        "| name | value |", "| --- | --- |", "| a | 0.123 |", "| 1 | – |", "| yes | no |"]


def test_the_last_letter_aligns_the_columns_behind_it():
    assert markdown_table("abc", [], "lr")[1] == "| --- | ---: | ---: |"
    assert markdown_table("abc", [], "lrlr")[1] == "| --- | ---: | --- |"


def test_numbers_show_what_is_known():
    assert (number(None), number(2, 0.25, 2), number(2.0)) == ("–", "2.00 ± 0.25", "2.000")
