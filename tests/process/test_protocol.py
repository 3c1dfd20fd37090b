"""What a process says while it has nothing new to say."""

import threading
import time

from lfsr_core.base.notices import Notice
from lfsr_core.process import protocol
from lfsr_core.process.protocol import emit, emit_last, emit_told, parse_progress, repeated

LONG_ENOUGH = 30  # seconds after which a machine is broken, not slow


def said(capsys, count: int) -> list[dict]:
    """At least so many records."""
    found, end = [], time.monotonic() + LONG_ENOUGH
    while len(found) < count and time.monotonic() < end:
        time.sleep(0.01)
        found += filter(None, map(parse_progress, capsys.readouterr().out.splitlines()))
    assert len(found) >= count
    return found


def test_the_last_progress_is_said_again_with_its_age(capsys):
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


def test_after_an_end_nothing_is_said_again(capsys):
    with repeated(0.01):
        emit(stage="render", fraction=0.25)
        emit(stage="rendered", folder="frame")
        time.sleep(0.1)  # for what was under way
        capsys.readouterr()
        time.sleep(0.1)
        assert capsys.readouterr().out == ""


def test_after_the_last_record_nobody_is_heard(capsys, monkeypatch):
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


def test_the_last_record_does_not_wait_for_one_that_hangs(capsys, monkeypatch):
    hung = threading.Lock()
    monkeypatch.setattr(protocol, "_speaking", hung)
    monkeypatch.setattr(protocol, "LONGEST_WAIT", 0.01)
    with hung:
        emit_last(stage="cancelled", message="stopped")
    assert "cancelled" in capsys.readouterr().out
