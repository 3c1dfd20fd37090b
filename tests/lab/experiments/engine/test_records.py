"""Kept measurements: read again while what they depend on is the same, measured again otherwise."""

from __future__ import annotations

import dataclasses

import pytest

from lfsr_lab.experiments.engine.records import Records


@dataclasses.dataclass(frozen=True)
class Kept:
    name: str
    seconds: float


@pytest.fixture
def cells(tmp_path):
    return Records(tmp_path, Kept)


def test_a_record_is_measured_once_per_fingerprint(cells):
    results = iter([Kept("a", 1.0), Kept("a", 2.0)])
    first = cells.get("one", {"weights": "x"}, lambda: next(results))
    assert first == Kept("a", 1.0) == cells.get("one", {"weights": "x"}, lambda: next(results))
    assert cells.get("one", {"weights": "y"}, lambda: next(results)) == Kept("a", 2.0)
    assert cells.read("one", {"weights": "x"}) is None and cells.read("two", {"weights": "x"}) is None


@pytest.mark.parametrize("text", ["", "{", "[]", "{}",
                                  '{"fingerprint": {"a": 1}, "record": {"name": 3, "seconds": 1.0}}',
                                  '{"fingerprint": {"a": 1}, "record": {"name": "n"}}'])
def test_a_damaged_file_is_measured_again(tmp_path, text):
    cells = Records(tmp_path, Kept)
    cells.path("one").write_text(text)
    assert cells.read("one", {"a": 1}) is None
    assert cells.get("one", {"a": 1}, lambda: Kept("n", 2.0)) == cells.read("one", {"a": 1})


def test_nothing_is_kept_of_a_measurement_that_fails(cells):
    with pytest.raises(ZeroDivisionError):
        cells.get("one", {}, lambda: Kept("a", 1 / 0))
    assert not cells.path("one").exists()
