"""Progress as it is shown, hints in sentences, and the cores that a process may use."""

import io
import itertools
import os
import time

import pytest

from lfsr_core.base.cores import CORES, usable_cores
from lfsr_core.base.errors import LfsrError, did_you_mean
from lfsr_core.base.notices import Notice, Progress
from lfsr_core.commands.common import ProgressBar


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def words(notice: Notice) -> str:
    return f"{notice.code} {notice.values['first']}"


def test_plain_lines_for_new_stages_and_ends_only():
    stream = io.StringIO()
    tell = ProgressBar(stream, words)
    for step in range(101):
        tell(Progress("render", step / 100, "samples"))
    tell(Progress("load", 0.0))
    tell.close()
    assert stream.getvalue().splitlines() == ["render       0%  samples", "render     100%  samples", "load         0%"]
    unused = Terminal()
    ProgressBar(unused, words).close()
    assert unused.getvalue() == ""


def test_terminal_line_moves_and_stays_in_place_within_a_stage():
    stream = Terminal()
    tell = ProgressBar(stream, words)
    tell(Progress("render", 0.0))
    tell(Progress("render", 0.5, "half"))
    tell(Progress("load", 2.0))
    tell.close()
    text = stream.getvalue()
    assert text.count("\n") == 2, "one before the second stage, one at the end"
    assert "\rrender     " + "█" * 15 + "░" * 15 + "  50%  half" in text
    assert "█" * 30 in text
    assert "█" * 31 not in text


def test_a_notice_has_its_own_line_once_also_amid_a_bar():
    stream = Terminal()
    tell = ProgressBar(stream, words)
    tell(Progress("render", 0.5))
    tell(Notice("image-missing", {"first": "wood.png"}))
    tell(Notice("image-missing", {"first": "wood.png"}))
    tell(Progress("render", 1.0))
    assert stream.getvalue().count("\nnote: image-missing wood.png\n") == 1


def test_a_record_a_second_makes_a_line_every_five_seconds_at_the_latest(monkeypatch):
    stream, now, shown = io.StringIO(), [100.0], []
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    tell = ProgressBar(stream, words)
    for second in range(60):
        before = len(stream.getvalue())
        tell(Progress("render", 0.0, f"Updating Scene BVH: Building, for {second} s"))
        shown += [second] * (len(stream.getvalue()) > before)
        now[0] += 1.04
    assert 12 <= len(shown) < 20
    assert all(1.04 * (after - before) <= 5 for before, after in itertools.pairwise(shown))


@pytest.mark.parametrize(("text", "expected"), [
    ("1", 1), ("0", 1), ("100000", os.cpu_count()), ("", os.cpu_count()), ("many", os.cpu_count())])
def test_the_environment_may_ask_for_fewer_cores(monkeypatch, text, expected):
    monkeypatch.setenv(CORES, text)
    assert usable_cores() == expected


FRUIT = ("apple", "banana", "cherry")


def test_a_message_is_one_line_and_names_what_is_near():
    assert did_you_mean("aple", FRUIT) == "did you mean 'apple'? "
    assert did_you_mean("xyz", FRUIT) == did_you_mean("apple", ()) == ""
    assert did_you_mean("berry", FRUIT, cutoff=0.9) == "" and "cherry" in did_you_mean("berry", FRUIT, cutoff=0.4)
    message = str(LfsrError("what is\nwrong " + "x" * 10_000 + " what to do"))
    assert len(message) <= 300
    assert message.startswith("what is wrong xx") and message.endswith("xx what to do")
