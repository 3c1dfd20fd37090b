"""One moving bar on a terminal, plain lines elsewhere."""

import io
import itertools
import time

from lfsr_core.base.notices import Notice, Progress, ProgressBar


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


def test_closing_an_unused_bar_prints_nothing():
    stream = Terminal()
    ProgressBar(stream, words).close()
    assert stream.getvalue() == ""


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
