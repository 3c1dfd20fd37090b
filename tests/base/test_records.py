"""Records: what comes back is what went in, and what is wrong is said in one sentence that names the place."""

import dataclasses
import io
import itertools
import json
import math
import os
import time
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfsr_core.base.messages import LfsrError, Notice, Progress, did_you_mean
from lfsr_core.base.records import from_data, read_record, to_data, write_record
from lfsr_core.base.system import CORES, usable_cores
from lfsr_core.commands.common import ProgressBar
from tests.support.told import refuses


@dataclasses.dataclass(frozen=True)
class Point:
    place: tuple[float, float]
    kind: Literal["win", "loss"] = "win"


@dataclasses.dataclass(frozen=True)
class Sheet:
    name: str
    count: int
    fraction: float = dataclasses.field(metadata={"key": "share"})
    flag: bool
    points: tuple[Point, ...] = ()
    seconds: dict[str, float] = dataclasses.field(default_factory=dict)
    best: Point | None = None
    pairs: tuple[tuple[int, int], ...] | None = None

    def __post_init__(self) -> None:
        if self.count < 0:
            raise LfsrError(f"count is {self.count}, but it must be 0 or more")


TEXT = st.text(st.characters(exclude_categories=["Cs"]))  # what UTF-8 holds; a table of it takes 3 s to make
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
POINTS = st.builds(Point, st.tuples(NUMBERS, NUMBERS), st.sampled_from(("win", "loss")))
WHOLE = st.integers(-10**9, 10**9)
SHEETS = st.builds(Sheet, TEXT, st.integers(0, 2**63 - 1), NUMBERS | WHOLE, st.booleans(),
                   st.lists(POINTS, max_size=3).map(tuple), st.dictionaries(TEXT, NUMBERS, max_size=3),
                   st.none() | POINTS, st.none() | st.lists(st.tuples(WHOLE, WHOLE), max_size=3).map(tuple))
GOOD: dict[str, Any] = {"name": "a", "count": 1, "share": 0.5, "flag": True,
                        "points": [{"place": [1, 2.5]}, {"place": [0.0, 0.0], "kind": "loss"}]}


@given(SHEETS)
def test_a_record_comes_back_from_json_as_it_went(sheet: Sheet) -> None:
    data = json.loads(json.dumps(to_data(sheet), allow_nan=False))
    assert data == to_data(sheet) and from_data(Sheet, data, "sheet") == sheet
    assert json.dumps(to_data(from_data(Sheet, data, "sheet"))) == json.dumps(data)


@pytest.mark.parametrize(("change", "parts"), [
    ({"count": 1.0}, ("count is 1.0", "a whole number")), ({"count": True}, ("count is True", "a whole number")),
    ({"share": True}, ("share is True", "a finite number")), ({"share": "0.5"}, ("share is '0.5'", "a finite number")),
    ({"share": math.nan}, ("share is nan", "a finite number")),
    ({"share": 10**400}, ("share is 1000", "a finite number")),
    ({"share": 2**64}, ("share is 18446744073709551616", "a number below 2⁶³, or with a point")),
    ({"points": [{"place": [1, -2**64]}]}, ("points[0].place[1] is -18446744073709551616", "below 2⁶³, or with")),
    ({"flag": 1}, ("flag is 1", "true or false")), ({"name": None}, ("name is None", "text")),
    ({"points": "ab"}, ("points is 'ab'", "a list")),
    ({"points": [*GOOD["points"], {"place": [1, 2, 3]}]}, ("points[2].place is [1, 2, 3]", "a list of 2 entries")),
    ({"points": [{"place": [1, "x"]}]}, ("points[0].place[1] is 'x'", "a finite number")),
    ({"points": [{"place": [1, 2], "kind": "draw"}]}, ("points[0].kind is 'draw'", "one of win, loss")),
    ({"points": [{"kind": "win"}]}, ("points[0]: field 'place' is missing; every Point needs it",)),
    ({"best": {"place": [1, 2], "colour": 3}}, ("best: unknown field 'colour'; the fields are place, kind",)),
    ({"best": [1]}, ("best is [1]", "an object")),
    ({"seconds": {"load": None}}, ("seconds.load is None", "a finite number")),
    ({"seconds": [1]}, ("seconds is [1]", "an object")),
    ({"pairs": [[1, 2.5]]}, ("pairs[0][1] is 2.5", "a whole number")),
    ({"count": -1}, ("count is -1, but it must be 0 or more",)), ({"name": 7, "share": 1}, ("name is 7", "text")),
    ({"points": [0] * 10000}, ("points[0] is 0", "an object")), ({"count": 10**400}, ("count is 1000", "below 2⁶³")),
    ({"name": "\ud800"}, ("name is '\\ud800'", "UTF-8")),
    ({"name": "long " * 1000}, ("name is 'long", "at most 4096 characters")),
    ({"flag": "long " * 1000}, ("flag is 'long", "true or false"))])
def test_what_is_wrong_is_one_sentence_with_its_place(change: dict[str, Any], parts: tuple[str, ...]) -> None:
    with pytest.raises(LfsrError) as caught:
        from_data(Sheet, GOOD | change, "/a/folder/" * 30 + "sheet.json")
    message = str(caught.value)
    assert all(part in message for part in ("sheet.json: ", *parts))
    assert len(message) <= 300 and "\n" not in message


def test_missing_and_misspelt_fields_are_named_and_a_message_is_one_line():
    with pytest.raises(LfsrError, match="sheet: field 'flag' is missing; every Sheet needs it"):
        from_data(Sheet, {key: value for key, value in GOOD.items() if key != "flag"}, "sheet")
    refuses("sheet: unknown field 'cuont'; did you mean 'count'", from_data, Sheet, GOOD | {"cuont": 3}, "sheet")
    for data in [None, [], "text", 3]:
        refuses("sheet: it is .*, but it must be an object", from_data, Sheet, data, "sheet")
    assert did_you_mean("aple", FRUIT) == "did you mean 'apple'? "
    assert did_you_mean("xyz", FRUIT) == did_you_mean("apple", ()) == ""
    assert did_you_mean("berry", FRUIT, cutoff=0.9) == "" and "cherry" in did_you_mean("berry", FRUIT, cutoff=0.4)
    message = str(LfsrError("what is\nwrong " + "x" * 10_000 + " what to do"))
    assert len(message) <= 300
    assert message.startswith("what is wrong xx") and message.endswith("xx what to do")


def test_what_could_not_be_read_back_is_not_written_and_a_file_holds_a_record(tmp_path):
    with pytest.raises(LfsrError, match="share is inf, but it must be a finite number"):
        write_record(tmp_path / "sheet.json", Sheet("a", 1, math.inf, True))
    assert not list(tmp_path.iterdir())
    write_record(tmp_path / "sheet.json", Sheet("a", np.int64(3), np.float32(0.5), np.bool_(True)))
    assert read_record(tmp_path / "sheet.json", Sheet, "a sheet") == Sheet("a", 3, 0.5, True)
    sheet = from_data(Sheet, GOOD, "sheet")
    write_record(tmp_path / "sheet.json", sheet)
    assert read_record(tmp_path / "sheet.json", Sheet, "a sheet") == sheet
    refuses(r"other\.json does not exist, expected a sheet", read_record, tmp_path / "other.json", Sheet, "a sheet")


@settings(max_examples=50)
@given(st.recursive(st.none() | st.booleans() | st.integers() | st.floats() | TEXT,
                    lambda inner: st.lists(inner) | st.dictionaries(TEXT | st.sampled_from(list(GOOD)), inner)))
def test_any_other_data_is_taken_unchanged_or_refused_in_one_sentence(data: Any) -> None:
    try:
        sheet = from_data(Sheet, data, "sheet")
    except LfsrError as error:
        assert len(str(error)) <= 300
    else:
        assert {key: to_data(sheet)[key] for key in data} == data


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_plain_lines_for_new_stages_and_ends_and_every_five_seconds_at_the_latest(monkeypatch):
    stream = io.StringIO()
    tell = ProgressBar(stream)
    for step in range(101):
        tell(Progress("render", step / 100, "samples"))
    tell(Progress("load", 0.0))
    tell.close()
    assert stream.getvalue().splitlines() == ["render       0%  samples", "render     100%  samples", "load         0%"]
    unused = Terminal()
    ProgressBar(unused).close()
    assert unused.getvalue() == ""
    stream, now, shown = io.StringIO(), [100.0], []
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    tell = ProgressBar(stream)
    for second in range(60):
        before = len(stream.getvalue())
        tell(Progress("render", 0.0, f"Updating Scene BVH: Building, for {second} s"))
        shown += [second] * (len(stream.getvalue()) > before)
        now[0] += 1.04
    assert 12 <= len(shown) < 20 and all(1.04 * (after - before) <= 5 for before, after in itertools.pairwise(shown))


def test_terminal_line_moves_within_a_stage_and_a_notice_has_its_own_line_once_also_amid_a_bar():
    stream = Terminal()
    tell = ProgressBar(stream)
    tell(Progress("render", 0.0))
    tell(Progress("render", 0.5, "half"))
    tell(Progress("load", 2.0))
    tell.close()
    text = stream.getvalue()
    assert text.count("\n") == 2, "one before the second stage, one at the end"
    assert "\rrender     " + "█" * 15 + "░" * 15 + "  50%  half" in text
    assert "█" * 30 in text and "█" * 31 not in text
    stream = Terminal()
    tell = ProgressBar(stream)
    tell(Progress("render", 0.5))
    tell(Notice("motion-ignored"))
    tell(Notice("motion-ignored"))
    tell(Progress("render", 1.0))
    assert stream.getvalue().count("\nnote: motion blur is ignored\n") == 1


@pytest.mark.parametrize(("text", "expected"), [
    ("1", 1), ("0", 1), ("100000", os.cpu_count()), ("", os.cpu_count()), ("many", os.cpu_count())])
def test_the_environment_may_ask_for_fewer_cores(monkeypatch, text, expected):
    monkeypatch.setenv(CORES, text)
    assert usable_cores() == expected


FRUIT = ("apple", "banana", "cherry")
