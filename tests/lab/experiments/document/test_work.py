"""Units are measured once, whoever measures them, and go on where they were stopped; one that fails stops no other."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_lab.experiments.document import study as document
from lfsr_lab.experiments.document.studies import SHORT, Table, read_table, units
from lfsr_lab.experiments.document.work import Work, joined

TIMEOUT = 300  # seconds: a busy machine starts Python slowly
# A unit's command: it counts its runs, keeps what is done, and needs a moment for each of three pieces.
COMMAND = """
import json, pathlib, sys, time
folder = pathlib.Path(sys.argv[1])
with (folder / "runs.txt").open("a") as runs: runs.write("run\\n")
for piece in range(3):
    part = folder / f"piece-{piece}"
    if not part.exists():
        time.sleep(0.1)
        part.touch()
        with (folder / "pieces.txt").open("a") as pieces: pieces.write(f"{piece}\\n")
(folder / "images").mkdir(exist_ok=True)
(folder / "images" / f"{folder.name}.png").write_bytes(b"an image")
(folder / "record.json").write_text(json.dumps({"found": [folder.name]}))
"""
WAITING = """
import pathlib, sys, time
folder = pathlib.Path(sys.argv[1])
with (folder / "runs.txt").open("a") as runs: runs.write("run\\n")
while not (folder / "go").exists(): time.sleep(0.05)
"""
DRIVER = """
import sys
from pathlib import Path
from lfsr_core.cli import _interrupt
import signal
signal.signal(signal.SIGTERM, _interrupt)
from lfsr_lab.experiments.document import study
from lfsr_lab.experiments.document.studies import read_table
from lfsr_lab.experiments.document.work import Work
folder, table = map(Path, sys.argv[1:])
table = read_table(table)
study.measure(Work(folder, table), "short", table.study)
"""
STUDY = """
[[asset]]
name = "vase"
file = "vase/vase.gltf"
licence = "CC0-1.0"
source = "a museum"

[[study]]
name = "study"
kind = "chart"
title = "A study"
question = "Does it run?"
record = "record.json"
joined = "found"
[study.short]
minutes = 1
each = [{each}]
command = "python {script} {{out}} {more}"
"""


def table(folder: Path, *each: str, more: str = "") -> Path:
    script = folder / "command.py"
    script.write_text(COMMAND, encoding="utf-8")
    path = folder / "table.toml"
    path.write_text(STUDY.format(each=", ".join(f'"{name}"' for name in each), script=script, more=more),
                    encoding="utf-8")
    return path


def driver(folder: Path, path: Path) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, "-c", DRIVER, str(folder), str(path)], stderr=subprocess.PIPE, text=True)


def lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").split() if path.exists() else []


def every(found: Table):
    return units(found.study, SHORT)


def wait_for(path: Path) -> None:
    until = time.monotonic() + TIMEOUT
    while not path.exists():
        assert time.monotonic() < until, f"{path} does not come"
        time.sleep(0.01)


def test_two_processes_share_the_units_and_measure_none_twice(tmp_path):
    path, out = table(tmp_path, "a", "b", "c", "d", "e"), tmp_path / "out"
    told = [process.communicate(timeout=TIMEOUT)[1] for process in [driver(out, path) for _ in range(2)]]
    work = Work(out, read_table(path))
    for process in [driver(out, path)]:  # what the other held when this one looked
        process.communicate(timeout=TIMEOUT)
    assert all(work.is_whole(unit) for unit in every(work.table))
    assert [lines(out / "study" / name / "runs.txt") for name in "abcde"] == [["run"]] * 5
    assert "another process measures it" in "".join(told)


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_a_run_that_was_stopped_goes_on(tmp_path, how):
    path, out = table(tmp_path, "a", "b"), tmp_path / "out"
    process = driver(out, path)
    wait_for(out / "study" / "b" / "piece-0")
    process.send_signal(how)
    process.communicate(timeout=TIMEOUT)
    work = Work(out, read_table(path))
    first, second = every(work.table)
    assert work.is_whole(first) and not work.is_whole(second)
    deadline = time.monotonic() + TIMEOUT
    while not work.is_whole(second):  # after SIGKILL its command lives on for a moment, and keeps the unit
        assert time.monotonic() < deadline
        driver(out, path).communicate(timeout=TIMEOUT)
    assert lines(out / "study" / "a" / "runs.txt") == ["run"]
    assert sorted(lines(out / "study" / "b" / "pieces.txt")) == ["0", "1", "2"]  # each once: the unit went on


@pytest.mark.skipif(sys.platform == "win32", reason="there a job object ends the command")
def test_a_unit_stays_claimed_while_its_command_outlives_a_killed_run(tmp_path):
    path, out = table(tmp_path, "a"), tmp_path / "out"
    (tmp_path / "command.py").write_text(WAITING, encoding="utf-8")
    process = driver(out, path)
    wait_for(out / "study/a/runs.txt")
    process.kill()
    process.communicate(timeout=TIMEOUT)
    try:
        assert "another process measures it" in driver(out, path).communicate(timeout=TIMEOUT)[1]
        assert lines(out / "study/a/runs.txt") == ["run"]
    finally:
        (out / "study/a/go").touch()


def test_cancel_ends_the_command(tmp_path):
    path, out = table(tmp_path, "a"), tmp_path / "out"
    (tmp_path / "command.py").write_text("import os, pathlib, sys, time\npathlib.Path(sys.argv[1], 'pid')"
                                         ".write_text(str(os.getpid()))\ntime.sleep(600)\n", encoding="utf-8")
    process = driver(out, path)
    wait_for(out / "study" / "a" / "pid")
    while not (pid := (out / "study" / "a" / "pid").read_text(encoding="utf-8")):
        time.sleep(0.01)
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=TIMEOUT)
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid), 0)
    assert not (out / "study" / "a" / "unit.json").exists()


def test_a_missing_asset_is_one_sentence_and_the_others_go_on(tmp_path):
    path = table(tmp_path, "vase", "b", more="{b}")
    path.write_text(path.read_text(encoding="utf-8").replace("{b}", "{scene}"), encoding="utf-8")
    text = path.read_text(encoding="utf-8").replace("[[study]]", '[[asset]]\nname = "b"\nfile = "b.blend"\nlicence = '
                                                    '"CC0-1.0"\nsource = "here"\n\n[[study]]', 1)
    path.write_text(text, encoding="utf-8")
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "b.blend").write_bytes(b"a scene")
    work = Work(tmp_path / "out", read_table(path), tmp_path / "assets")
    document.measure(work, SHORT, work.table.study)
    missing, there = (work.ended(unit) for unit in every(work.table))
    assert missing is not None and there is not None
    assert missing.sentence == ("vase is not there (vase/vase.gltf; CC0-1.0; a museum): put it below the folder that "
                                "--assets names")
    assert there.sentence == "" and there.inputs == {"b": {"b.blend": hashlib.sha256(b"a scene").hexdigest()}}
    work.gather(every(work.table))
    assert json.loads((tmp_path / "out/measured/study.json").read_text(encoding="utf-8")) == {"found": ["b"]}
    assert (tmp_path / "out/images/b.png").read_bytes() == b"an image"
    (tmp_path / "assets" / "vase").mkdir()
    (tmp_path / "assets" / "vase" / "vase.gltf").write_bytes(b"a vase")
    (tmp_path / "assets" / "vase" / "vase.bin").write_bytes(b"its mesh")
    document.measure(work, SHORT, work.table.study)  # what failed is tried again
    ended = work.ended(every(work.table)[0])
    assert ended is not None and ended.sentence == ""
    assert ended.inputs["vase"] == {"vase.gltf": hashlib.sha256(b"a vase").hexdigest(),
                                    "vase.bin": hashlib.sha256(b"its mesh").hexdigest()}


def test_a_command_that_fails_leaves_its_last_words(tmp_path):
    path = table(tmp_path, "a")
    (tmp_path / "command.py").write_text("print('out of lamps'); raise SystemExit(2)\n", encoding="utf-8")
    work = Work(tmp_path / "out", read_table(path))
    document.measure(work, SHORT, work.table.study)
    assert work.ended(every(work.table)[0]).sentence == "out of lamps"


def test_a_unit_waits_for_those_that_it_reads(tmp_path):
    path = table(tmp_path, "a")
    text = path.read_text(encoding="utf-8")
    study = text[text.index("[[study]]"):]
    reading = study.replace('name = "study"', 'name = "reader"').replace("minutes", 'after = "study"\nminutes')
    path.write_text(text + reading, encoding="utf-8")
    work = Work(tmp_path / "out", read_table(path))
    first, reader = every(work.table)
    document.measure(work, SHORT, [reader.study])
    assert work.ended(reader).sentence == "it needs study/a, which has not ended: run the command again after that"
    document.measure(work, SHORT, work.table.study)
    assert work.is_whole(first) and work.is_whole(reader)


def test_parts_cover_all_units_once(tmp_path):
    path = table(tmp_path, "a", "b", "c")
    work = Work(tmp_path / "out", read_table(path))
    document.measure(work, SHORT, work.table.study, part=(2, 2))
    assert [work.is_whole(unit) for unit in every(work.table)] == [False, True, False]
    document.measure(work, SHORT, work.table.study, part=(1, 2))
    assert all(work.is_whole(unit) for unit in every(work.table))
    assert [lines(work.folder / "study" / name / "runs.txt") for name in "abc"] == [["run"]] * 3


def test_a_folder_keeps_its_form(tmp_path):
    work = Work(tmp_path / "out", read_table(table(tmp_path, "a")))
    document.measure(work, SHORT, work.table.study)
    with pytest.raises(LfsrError, match="was begun with --short: choose another folder for --long"):
        document.measure(work, "long", work.table.study)


def test_records_of_units_are_joined_by_list_or_by_name(tmp_path):
    study = read_table(table(tmp_path, "a")).study[0]
    files = []
    for number, found in enumerate(([1], [2, 3]), start=1):
        files.append(tmp_path / f"{number}.json")
        files[-1].write_text(json.dumps({"settings": "same", "found": found}), encoding="utf-8")
    assert joined(study, files) == {"settings": "same", "found": [1, 2, 3]}
    for file, found in zip(files, ({"x": 1}, {"y": 2}), strict=True):
        file.write_text(json.dumps({"found": found}), encoding="utf-8")
    assert joined(study, files) == {"found": {"x": 1, "y": 2}}
