"""Pages: whole, self-contained, and nothing in them is taken for markup."""

from __future__ import annotations

import re

import pytest
from jinja2 import DictLoader, UndefinedError

from lfsr_lab.experiments import page

TABLE = """{% extends "base.html" %}{% import "macros.html" as macros %}{% block title %}T{% endblock %}
{% block body %}{{ macros.table(["name", "n"], rows) }}{{ picture }}{% endblock %}"""


@pytest.fixture
def templates(monkeypatch):
    """The package's templates and one of this test."""
    from jinja2 import ChoiceLoader

    environment = page._templates()
    both = ChoiceLoader([DictLoader({"test.html": TABLE}), environment.loader])
    monkeypatch.setattr(environment, "loader", both)


def test_text_is_escaped_and_pictures_are_not(templates):
    svg = page.inline_svg('<?xml version="1.0"?>\n<!DOCTYPE svg>\n<svg><title>t</title></svg>', 'a & b')
    html = page.page_html("test.html", rows=[["<b>", 1]], picture=svg)
    assert '<td class="l">&lt;b&gt;</td><td>1</td>' in html
    assert '<svg role="img" aria-label="a &amp; b"><title>t</title></svg>' in html
    assert html.startswith("<!doctype html>") and "<?xml" not in html
    assert not re.search(r"<script|<link|url\(|@import", html)


def test_a_value_that_the_template_wants_must_be_given(templates):
    with pytest.raises(UndefinedError, match="picture"):
        page.page_html("test.html", rows=[])
