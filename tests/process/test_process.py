"""Child processes: what they write arrives, and none outlives its use."""

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from lfsr_core.base.messages import Notice
from lfsr_core.process import child as protocol
from lfsr_core.process.child import Child, emit, emit_last, emit_told, output_of, parse_progress, repeated
from tests.support.told import refuses

SPEAKER = """import sys
print("Fra:1", flush=True)
print('Fra:1, cut LFSR {"stage": "scene", "index": 3}', flush=True)
sys.stdin.read()"""
# A child and a grandchild that do not read their input.
DEAF = "sleep 60 & echo \"LFSR {\\\"stage\\\": \\\"x\\\", \\\"pid\\\": $!}\"; while :; do sleep 9; done"
# A child that ends before its own child, which holds its output open.
HASTY = "sleep 60 & echo \"LFSR {\\\"stage\\\": \\\"done\\\", \\\"pid\\\": $!}\""
REFUSAL = """print('LFSR {"stage": "error", "message": "bad"}'); raise SystemExit(2)"""
HOLDER = f"""import os, sys
from lfsr_core.process.child import Child
child = Child([sys.executable, "-c", {SPEAKER!r}])
print(child.pid, flush=True)
os._exit(1)"""


def wait_until_gone(pid: int) -> None:
    """Fail where a process lives on; a zombie, whose parent died without collecting it, counts as gone."""
    status, end = Path(f"/proc/{pid}/stat"), time.monotonic() + 20
    while status.exists() and ") Z" not in status.read_text():
        assert time.monotonic() < end, f"{pid} lives on"
        time.sleep(0.02)


def test_a_child_ends_with_its_input_and_with_a_parent_that_dies():
    lines = []
    with Child([sys.executable, "-c", SPEAKER], log=lines.append) as child:
        assert next(child.records()) == {"stage": "scene", "index": 3} == child.last
        assert child._process.poll() is None and len(lines) == 2
    assert child._process.poll() is not None
    with Child([sys.executable, "-c", SPEAKER]) as first, Child([sys.executable, "-c", SPEAKER]) as second:
        threading.Timer(0.2, Child.stop_all).start()
        assert len(list(first.records())) == len(list(second.records())) == 1
    answer = subprocess.run([sys.executable, "-c", HOLDER], capture_output=True, text=True, check=False)
    wait_until_gone(int(answer.stdout))


def test_a_deaf_child_is_killed_with_its_own_and_one_of_low_priority_nicer():
    with Child(["/bin/sh", "-c", DEAF]) as child:
        pid, started = next(child.records())["pid"], time.monotonic()
        child.stop(0.2)
        assert time.monotonic() - started < 5 and child._process.poll() is not None
    wait_until_gone(pid)
    started = time.monotonic()
    with Child(["/bin/sh", "-c", HASTY]) as child:
        assert [record["stage"] for record in child.records()] == ["done"] and child.is_done()
    wait_until_gone(child.last["pid"])
    assert time.monotonic() - started < 30
    script = """import json, os, subprocess, sys, time
time.sleep(0.2)
child = subprocess.run([sys.executable, "-c", "import os; print(os.nice(0))"], capture_output=True, text=True)
print("LFSR " + json.dumps({"stage": "done", "nice": [os.nice(0), int(child.stdout)]}))"""
    for low_priority in (False, True):
        with Child([sys.executable, "-c", script], low_priority=low_priority) as child:
            assert list(child.records())[-1]["nice"] == [min(19, os.nice(0) + low_priority * 10)] * 2


def test_how_a_child_ended_is_one_sentence_and_the_output_of_a_command():
    with Child([sys.executable, "-c", "print('out of memory'); raise SystemExit(3)"]) as child:
        assert not list(child.records()) and not child.is_done()
        sentence = "the render stopped with exit code 3 before it was done, last printing 'out of memory': try again"
        child.ask("more")  # of nobody
        assert str(child.crash("the render stopped with", "try again")) == sentence
    with Child([sys.executable, "-c", REFUSAL]) as child:
        assert len(list(child.records())) == 1
        refuses("^bad$", child.is_done)
    code = "import os, sys; print(os.environ['GIVEN'], flush=True); print('both', file=sys.stderr); sys.exit(4)"
    assert output_of([sys.executable, "-c", code], os.environ | {"GIVEN": "one"}) == (4, "one\nboth\n")
    with pytest.raises(TimeoutError, match="no answer within 0 s"):
        output_of([sys.executable, "-c", "import time; time.sleep(1)"], seconds=0.1)
    with pytest.raises(OSError, match="No such file"):
        output_of(["/no/such/program"])


LONG_ENOUGH = 30  # seconds after which a machine is broken, not slow


def said(capsys, count: int) -> list[dict]:
    """At least so many records."""
    records, end = [], time.monotonic() + LONG_ENOUGH
    while len(records) < count and time.monotonic() < end:
        time.sleep(0.01)
        records += filter(None, map(parse_progress, capsys.readouterr().out.splitlines()))
    assert len(records) >= count
    return records


def test_the_last_progress_is_said_again_with_its_age_and_nothing_after_an_end(capsys):
    with repeated(0.01):
        emit(stage="render", fraction=0.25, message="Updating Scene BVH: Building")
        emit_told(Notice("file-unreadable", {"path": "wood.png"}))
        first, warning, *again = said(capsys, 5)
    assert first["message"] == "Updating Scene BVH: Building" and warning["notice"] == "file-unreadable"
    for record in again:
        assert (record["stage"], record["fraction"]) == ("render", 0.25)
        assert record["message"] == "Updating Scene BVH: Building, for 0 s"
    capsys.readouterr()
    time.sleep(0.05)
    assert capsys.readouterr().out == "", "after the block nothing follows what was said last"
    with repeated(0.01):
        emit(stage="render", fraction=0.25)
        emit(stage="rendered", folder="frame")
        time.sleep(0.1)  # for what was under way
        capsys.readouterr()
        time.sleep(0.1)
        assert capsys.readouterr().out == ""


def test_after_the_last_record_nobody_is_heard_and_it_does_not_wait_for_one_that_hangs(capsys, monkeypatch):
    monkeypatch.setattr(protocol, "_speaking", threading.Lock())
    emit_last(stage="cancelled", message="stopped")
    late = threading.Thread(target=emit, kwargs={"stage": "render", "message": "late"}, daemon=True)
    late.start()
    late.join(0.2)
    heard = capsys.readouterr().out
    protocol._speaking.release()
    late.join()
    assert "cancelled" in heard and "late" not in heard
    assert "late" in capsys.readouterr().out, "only the end of the process silences it"
    hung = threading.Lock()
    monkeypatch.setattr(protocol, "_speaking", hung)
    monkeypatch.setattr(protocol, "LONGEST_WAIT", 0.01)
    with hung:
        emit_last(stage="cancelled", message="stopped")
    assert "cancelled" in capsys.readouterr().out
