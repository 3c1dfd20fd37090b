"""Units are measured once, whoever measures them, and go on where they were stopped; one that fails stops no other."""

import collections
import hashlib
import json
import os
import re
import shlex
import signal
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

from lfsr_core.base.records import write_record
from lfsr_core.cli import build_parser
from lfsr_lab.experiments.animations.study import NAMES as ANIMATIONS
from lfsr_lab.experiments.document import page
from lfsr_lab.experiments.document import study as document
from lfsr_lab.experiments.document.work import LONG, SHORT, Table, Unit, Work, joined, read_table, units
from lfsr_lab.experiments.engine.report import markdown_table
from lfsr_lab.experiments.sweeps.records import SWEEPS
from tests.support.browser import CHROMIUM
from tests.support.chart_example import example
from tests.support.processes import ROOT, wait_for
from tests.support.told import refuses

TIMEOUT = 300  # seconds: a busy machine starts Python slowly
# A command: it counts its runs, keeps what is done of three pieces, and waits while its folder has a file "wait".
COMMAND = """
import json, os, pathlib, sys, time
folder = pathlib.Path(sys.argv[1])
with (folder / "runs.txt").open("a") as runs: runs.write("run\\n")
for piece in range(3):
    part = folder / f"piece-{piece}"
    if not part.exists():
        time.sleep(0.1)
        part.touch()
        with (folder / "pieces.txt").open("a") as pieces: pieces.write(f"{piece}\\n")
    if piece == 0: (folder / "pid").write_text(str(os.getpid())); (folder / "begun").touch()
    while (folder / "wait").exists(): time.sleep(0.05)
(folder / "images").mkdir(exist_ok=True)
(folder / "images" / f"{folder.name}.png").write_bytes(b"an image")
(folder / "record.json").write_text(json.dumps({"rows": [folder.name]}))
"""
DRIVER = """
import sys
from pathlib import Path
from lfsr_core.cli import _interrupt
import signal
signal.signal(signal.SIGTERM, _interrupt)
from lfsr_lab.experiments.document import study
from lfsr_lab.experiments.document.work import read_table
from lfsr_lab.experiments.document.work import Work
folder, table = map(Path, sys.argv[1:])
table = read_table(table)
study.measure(Work(folder, table), "short", table.study)
"""
ASSET = '[[asset]]\nname = "{name}"\nfile = "{file}"\nlicence = "CC0-1.0"\nsource = "a museum"\n'
STUDY = """
[[study]]
name = "study"
kind = "chart"
title = "A study"
question = "Does it run?"
record = "record.json"
joined = "rows"
[study.short]
minutes = 1
units = [{units}]
command = "python {script} {{out}} {more}"
"""


def work_of(folder: Path, *names: str, more: str = "", command: str = COMMAND) -> Work:
    """Units of these names in ``folder``/out, whose table and command are in ``folder``."""
    (folder / "command.py").write_text(command, encoding="utf-8")
    assets = ASSET.format(name="vase", file="vase/vase.gltf") + ASSET.format(name="b", file="b.blend")
    study = STUDY.format(units=", ".join(f'"{name}"' for name in names), script=folder / "command.py", more=more)
    (folder / "table.toml").write_text(assets + study, encoding="utf-8")
    return Work(folder / "out", read_table(folder / "table.toml"), folder / "assets")


def driver(folder: Path) -> subprocess.Popen[str]:
    """Measure the units of ``work_of`` in another process."""
    return subprocess.Popen([sys.executable, "-c", DRIVER, str(folder / "out"), str(folder / "table.toml")],
                            stderr=subprocess.PIPE, text=True)


def ended(process: subprocess.Popen[str]) -> str:
    return process.communicate(timeout=TIMEOUT)[1]


def lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").split() if path.exists() else []


def every(table: Table):
    return units(table.study, SHORT)


def test_processes_share_the_units_and_measure_none_twice(tmp_path):
    work = work_of(tmp_path, "a", "b", "c")
    told = [ended(process) for process in [driver(tmp_path) for _ in range(2)]]
    document.measure(work, SHORT, work.table.study)  # what the other held when this one looked
    assert all(work.is_whole(unit) for unit in every(work.table))
    assert [lines(work.folder / "study" / name / "runs.txt") for name in "abc"] == [["run"]] * 3
    assert "another process measures it" in "".join(told)


@pytest.mark.skipif(sys.platform == "win32", reason="there a job object ends the command")
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_a_run_that_was_stopped_goes_on(tmp_path, how):
    """SIGTERM ends the unit's command; after SIGKILL it lives on and keeps its unit claimed."""
    work = work_of(tmp_path, "a", "b")
    unit = work.folder / "study" / "b"
    unit.mkdir(parents=True)
    (unit / "wait").touch()
    process = driver(tmp_path)
    wait_for((unit / "begun").exists, TIMEOUT)
    process.send_signal(how)
    ended(process)
    first, second = every(work.table)
    assert work.is_whole(first) and not work.is_whole(second) and not (unit / "unit.json").exists()
    if how == signal.SIGTERM:
        with pytest.raises(ProcessLookupError):
            os.kill(int((unit / "pid").read_text()), 0)
    else:
        document.measure(work, SHORT, work.table.study)
        assert not work.is_whole(second) and lines(unit / "runs.txt") == ["run"]
    (unit / "wait").unlink()
    wait_for(lambda: document.measure(work, SHORT, work.table.study) or work.is_whole(second), TIMEOUT)
    assert lines(work.folder / "study" / "a" / "runs.txt") == ["run"]
    assert sorted(lines(unit / "pieces.txt")) == ["0", "1", "2"]  # each once: the unit went on


def test_a_missing_asset_is_one_sentence_and_the_others_go_on(tmp_path):
    work = work_of(tmp_path, "vase", "b", more="{scene}")
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "b.blend").write_bytes(b"a scene")
    document.measure(work, SHORT, work.table.study)
    missing, there = (work.ended(unit) for unit in every(work.table))
    assert missing.sentence == ("vase is not there (vase/vase.gltf; CC0-1.0; a museum): put it below the folder that "
                                "--assets names")
    assert there.sentence == "" and there.inputs == {"b": {"b.blend": hashlib.sha256(b"a scene").hexdigest()}}
    work.gather(every(work.table))
    assert json.loads((work.folder / "measured/study.json").read_text(encoding="utf-8")) == {"rows": ["b"]}
    assert (work.folder / "images/b.png").read_bytes() == b"an image"
    (tmp_path / "assets" / "vase").mkdir()
    (tmp_path / "assets" / "vase" / "vase.gltf").write_bytes(b"a vase")
    (tmp_path / "assets" / "vase" / "vase.bin").write_bytes(b"its mesh")
    document.measure(work, SHORT, work.table.study)  # what failed is tried again
    result = work.ended(every(work.table)[0])
    assert result.sentence == ""
    assert result.inputs["vase"] == {"vase.gltf": hashlib.sha256(b"a vase").hexdigest(),
                                     "vase.bin": hashlib.sha256(b"its mesh").hexdigest()}


def test_a_unit_waits_for_those_that_it_reads(tmp_path):
    path = work_of(tmp_path, "a").folder.parent / "table.toml"
    text = path.read_text(encoding="utf-8")
    study = text[text.index("[[study]]"):]
    path.write_text(text + study.replace('"study"', '"reader"').replace("minutes", 'after = "study"\nminutes'), "utf-8")
    work = Work(tmp_path / "out", read_table(path))
    first, reader = every(work.table)
    document.measure(work, SHORT, [reader.study])
    assert work.ended(reader).sentence == "it needs study/a, which has not ended: run the command again after that"
    document.measure(work, SHORT, work.table.study)
    assert work.is_whole(first) and work.is_whole(reader)
    (tmp_path / "other").mkdir()
    work = work_of(tmp_path / "other", "a", command="print('out of lamps'); raise SystemExit(2)\n")
    document.measure(work, SHORT, work.table.study)
    assert work.ended(every(work.table)[0]).sentence == "out of lamps", "the last words of a command that fails"


def test_parts_cover_all_units_once_and_a_folder_keeps_its_form(tmp_path):
    work = work_of(tmp_path, "a", "b", "c")
    refuses("holds no records to draw", list, document.draw(work))
    document.measure(work, SHORT, work.table.study, part=(2, 2))
    assert [work.is_whole(unit) for unit in every(work.table)] == [False, True, False]
    document.measure(work, SHORT, work.table.study, part=(1, 2))
    assert all(work.is_whole(unit) for unit in every(work.table))
    assert [lines(work.folder / "study" / name / "runs.txt") for name in "abc"] == [["run"]] * 3
    refuses("begun with --short: choose another folder for --long", document.measure, work, "long", work.table.study)


@pytest.mark.parametrize(("parts", "whole"), [(([1], [2, 3]), [1, 2, 3]), (({"x": 1}, {"y": 2}), {"x": 1, "y": 2})])
def test_records_of_units_are_joined_by_list_or_by_name(tmp_path, parts, whole):
    study, files = work_of(tmp_path, "a").table.study[0], [tmp_path / "1.json", tmp_path / "2.json"]
    for file, rows in zip(files, parts, strict=True):
        file.write_text(json.dumps({"settings": "same", "rows": rows}), encoding="utf-8")
    assert joined(study, files) == {"settings": "same", "rows": whole}


RESULTS = ROOT / "docs" / "results"
TABLE = read_table()


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


def test_records_are_drawn_with_digest_command_and_seeds_and_one_that_cannot_be_loses_no_other(tmp_path, monkeypatch):
    monkeypatch.setattr(page.shutil, "which", lambda name: None)  # no browser: a page is enough here
    kept, work = tmp_path / "measured", Work(tmp_path, TABLE)
    kept.mkdir()
    write_record(kept / "small.json", example(2))
    (kept / "stress.json").write_text('{"format": 1, "measured": "for hours"}', encoding="utf-8")
    (kept / "denoiser.json").write_text("cut off in the mid", encoding="utf-8")
    (tmp_path / "manifest.json").write_text('{"form": "short"}', encoding="utf-8")
    before = {path.name: path.read_bytes() for path in kept.iterdir()}
    refuses(r"report\.html lacks", list, document.draw(work))
    assert {path.name: path.read_bytes() for path in kept.iterdir()} == before
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert text.count("<svg") == 10 and text.count("This record could not be drawn") == 2
    captions = re.findall(r"<figcaption>(.*?)</figcaption>", text, re.DOTALL)
    assert len(captions) == 10 and all("Made by <code>lfsr study chart" in caption for caption in captions)
    facts = json.loads((tmp_path / "manifest.json").read_text(encoding="utf-8"))
    record = next(record for record in facts["records"] if record["file"] == "small.json")
    assert record["sha256"] == hashlib.sha256(before["small.json"]).hexdigest()
    assert record["command"].startswith("lfsr study chart ") and record["machine"] and record["seeds"] == [0, 1, 2]
    assert {unit["state"] for unit in facts["units"]} == {"not measured"} and len(facts["units"]) > 5
    for path in kept.iterdir():
        path.unlink()
    list(document.draw(work))  # again, and now it can
    assert "could not be drawn" not in (tmp_path / "report.html").read_text(encoding="utf-8")


@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
def test_it_is_printed_where_there_is_a_browser(tmp_path):
    (tmp_path / "report.html").write_text("<!doctype html><title>One page</title><p>Hello", encoding="utf-8")
    printed = page.print_pdf(tmp_path / "report.html")
    assert printed is not None and printed.read_bytes().startswith(b"%PDF")


def test_markdown_becomes_html_and_stays_text():
    lines = ["## A *b* <c>", "", "One `x<y` and **two**.", "", *markdown_table(["a", "b"], [["x & y", 1.5]], "lr"),
             "", "- first", "  goes on", "- second"]
    text = str(page.html("\n".join(lines)))
    assert [tag for tag, _ in Reader(text).tags if tag in ("h4", "code", "b", "table", "li")] == [
        "h4", "code", "b", "table", "li", "li"]
    assert "<li>first goes on</li>" in text
    assert "A <i>b</i> &lt;c&gt;" in text and "x &amp; y" in text and "<td>1.500</td>" in text


def test_commands_of_the_table_are_accepted_and_the_short_form_is_meant_to_end_in_half_an_hour():
    short, long, shown = units(TABLE.study, SHORT), units(TABLE.study, LONG), Work(Path("out"), TABLE).shown
    assert 5 < sum(unit.form.minutes for unit in short) <= 30
    for unit in (*short, *long):
        _, *words = shlex.split(shown(unit))
        assert build_parser().parse_args(words).verb == "study", unit.title
    units_of = {study.name: set(study.long.units) for study in TABLE.study if study.long}
    assert units_of["stress"] == {sweep.name for sweep in SWEEPS} and units_of["shots"] <= set(ANIMATIONS)
    chart, stress = TABLE.study[0], next(study for study in TABLE.study if study.name == "stress")
    names = ",".join(stress.short.units)
    assert f"--sweeps {names} " in shown(Unit(stress, names, SHORT)), "the command of a study names all its units"
    assert "chart SCENE -o DIR" in shown(Unit(chart, ",".join(chart.long.units), LONG))


def test_the_report_of_the_documents_shows_the_records_as_they_are_and_can_be_read_alone():
    facts = json.loads((RESULTS / "manifest.json").read_text(encoding="utf-8"))
    text = (RESULTS / "report.html").read_text(encoding="utf-8")
    kept = {kept.file for study in TABLE.study for kept in study.kept}
    assert {Path(file).name for file in kept} == {record["file"] for record in facts["records"]}
    for file in kept:
        digest = hashlib.sha256((RESULTS / "measured" / file).read_bytes()).hexdigest()
        assert digest in text, f"{file} has changed: run `lfsr study report -o docs/results --draw`"
    assert "could not be drawn" not in text
    reader = Reader(text)
    assert len(text.encode()) <= 3_000_000
    assert all(link.startswith(("#", "data:")) or (RESULTS / link.partition("#")[0]).is_file() for link in reader.links)
    assert [name for name, count in reader.ids.items() if count > 1] == []
    assert {link[1:] for link in reader.links if link.startswith("#")} <= set(reader.ids)
    assert not any(tag == "script" for tag, _ in reader.tags)
    assert all(given.get("aria-label") for tag, given in reader.tags if tag == "svg")
    assert all(given.get("alt") for tag, given in reader.tags if tag == "img")
