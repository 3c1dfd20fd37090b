"""The document: each record drawn or its failure said, nothing measured lost, every digest right, readable alone."""

from __future__ import annotations

import collections
import hashlib
import json
import re
import shlex
from html.parser import HTMLParser
from pathlib import Path

import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.records import write_record
from lfsr_core.cli import build_parser
from lfsr_lab.experiments.animations.study import NAMES as ANIMATIONS
from lfsr_lab.experiments.document import page
from lfsr_lab.experiments.document import study as document
from lfsr_lab.experiments.document.studies import LONG, SHORT, Unit, read_table, units
from lfsr_lab.experiments.document.work import Work
from lfsr_lab.experiments.engine.report import markdown_table
from lfsr_lab.experiments.sweeps.sweeps import SWEEPS
from tests.support.browser import CHROMIUM
from tests.support.chart_example import example

ROOT = Path(__file__).parents[4]
RESULTS = ROOT / "docs" / "results"
TABLE = read_table()
VOID = {"meta", "br", "wbr", "img", "path", "use", "rect"}


class Reader(HTMLParser):
    """What a browser would find."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids, self.links, self.tags = collections.Counter[str](), list[str](), list[tuple[str, dict]]()
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.tags.append((tag, given))
        self.ids.update([given["id"]] if "id" in given else [])
        self.links += [given[name] for name in ("src", "href", "xlink:href") if name in given]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the records of a chart and of something that is no chart."""
    monkeypatch.setattr(page.shutil, "which", lambda name: None)  # no browser: a page is enough here
    (tmp_path / "measured").mkdir()
    write_record(tmp_path / "measured" / "small.json", example(2))
    (tmp_path / "manifest.json").write_text('{"form": "short"}', encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize("content", ['{"format": 1, "measured": "for hours"}', "cut off in the mid"])
def test_a_drawing_error_loses_no_record_and_no_other_figure(folder, content):
    broken = folder / "measured" / "stress.json"
    broken.write_text(content, encoding="utf-8")
    before = {path.name: path.read_bytes() for path in (folder / "measured").iterdir()}
    with pytest.raises(LfsrError, match=r"report\.html lacks"):
        list(document.draw(Work(folder, TABLE)))
    assert {path.name: path.read_bytes() for path in (folder / "measured").iterdir()} == before
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert text.count("<svg") == 10 and "This record could not be drawn" in text
    broken.unlink()
    list(document.draw(Work(folder, TABLE)))  # again, and now it can
    assert "could not be drawn" not in (folder / "report.html").read_text(encoding="utf-8")


def test_the_manifest_names_every_record_with_its_digest_command_machine_and_seeds(folder):
    list(document.draw(Work(folder, TABLE)))
    facts = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    [record] = facts["records"]
    assert record["sha256"] == hashlib.sha256((folder / "measured/small.json").read_bytes()).hexdigest()
    assert record["command"].startswith("lfsr study chart ") and record["machine"] and record["seeds"] == [0, 1, 2]
    assert {unit["state"] for unit in facts["units"]} == {"not measured"} and len(facts["units"]) > 5


def test_the_command_of_a_study_names_all_its_units():
    study = next(study for study in TABLE.study if study.name == "stress")
    every = Unit(study, ",".join(study.short.each), SHORT)
    assert f"--sweeps {','.join(study.short.each)} " in Work(Path("out"), TABLE).shown(every)
    chart = TABLE.study[0]
    assert "chart SCENE -o DIR" in Work(Path("out"), TABLE).shown(Unit(chart, ",".join(chart.long.each), LONG))


def test_every_figure_names_the_command_that_made_it(folder):
    list(document.draw(Work(folder, TABLE)))
    captions = re.findall(r"<figcaption>(.*?)</figcaption>", (folder / "report.html").read_text("utf-8"), re.DOTALL)
    assert len(captions) == 10 and all("Made by <code>lfsr study chart" in caption for caption in captions)


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
def test_it_is_printed_where_there_is_a_browser(tmp_path):
    (tmp_path / "report.html").write_text("<!doctype html><title>One page</title><p>Hello", encoding="utf-8")
    printed = page.print_pdf(tmp_path / "report.html")
    assert printed is not None and printed.read_bytes().startswith(b"%PDF")


def test_markdown_becomes_html_and_stays_text():
    lines = ["## A *b* <c>", "", "One `x<y` and **two**.", "", *markdown_table(["a", "b"], [["x & y", 1.5]], "lr"),
             "", "- first", "  goes on", "- second"]
    text = str(page.html("\n".join(lines)))
    reader = Reader(text)
    assert [tag for tag, _ in reader.tags if tag in ("h4", "code", "b", "table", "li")] == [
        "h4", "code", "b", "table", "li", "li"]
    assert "<li>first goes on</li>" in text
    assert "A <i>b</i> &lt;c&gt;" in text and "x &amp; y" in text and "<td>1.500</td>" in text


def test_the_short_form_is_meant_to_end_in_half_an_hour():
    assert 5 < sum(unit.form.minutes for unit in units(TABLE.study, SHORT)) <= 30


@pytest.mark.parametrize("unit", [*units(TABLE.study, SHORT), *units(TABLE.study, LONG)], ids=lambda unit: unit.title)
def test_a_command_of_the_table_is_one_that_its_program_accepts(unit: Unit):
    _, *words = shlex.split(Work(Path("out"), TABLE).shown(unit))
    assert build_parser().parse_args(words).verb == "study"


def test_the_long_form_has_every_sweep_and_animation():
    units_of = {study.name: set(study.long.each) for study in TABLE.study if study.long}
    assert units_of["stress"] == {sweep.name for sweep in SWEEPS}
    assert units_of["shots"] <= set(ANIMATIONS)


def test_the_report_of_the_documents_shows_the_records_as_they_are():
    facts = json.loads((RESULTS / "manifest.json").read_text(encoding="utf-8"))
    text = (RESULTS / "report.html").read_text(encoding="utf-8")
    kept = {kept.file for study in TABLE.study for kept in study.kept}
    assert {Path(file).name for file in kept} == {record["file"] for record in facts["records"]}
    for file in kept:
        digest = hashlib.sha256((RESULTS / "measured" / file).read_bytes()).hexdigest()
        assert digest in text, f"{file} has changed: run `lfsr study report -o docs/results --draw`"
    assert "could not be drawn" not in text


def test_the_report_of_the_documents_can_be_read_alone():
    path = RESULTS / "report.html"
    reader = Reader(path.read_text(encoding="utf-8"))
    assert path.stat().st_size <= 3_000_000
    assert all(link.startswith(("#", "data:")) for link in reader.links)
    assert [name for name, count in reader.ids.items() if count > 1] == []
    assert {link[1:] for link in reader.links if link.startswith("#")} <= set(reader.ids)
    assert not any(tag == "script" for tag, _ in reader.tags)
    assert all(given.get("aria-label") for tag, given in reader.tags if tag == "svg")
    assert all(given.get("alt") for tag, given in reader.tags if tag == "img")
