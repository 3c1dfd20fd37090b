"""The curves and tables of the sweeps."""

from __future__ import annotations

from lfsr_lab.experiments.sweeps import study
from lfsr_lab.experiments.sweeps.records import Break, Cell, Repeat, SweepReport


def test_a_curve_with_gaps_is_drawn_where_it_is_known(monkeypatch):
    cells = tuple(Cell(value, "scene", 16, "m", {"q": quality}, None)
                  for value, quality in ((1, 0.9), (2, None), (3, 0.7)))
    dial = SweepReport("d", "meaning", "unit", "q", (1, 2, 3), cells, {"m": Break(3, 0.7, "below its start")})
    figures = []
    monkeypatch.setattr(study, "svg", lambda figure: figures.append(figure) or "<svg></svg>")
    study.curves(dial, ["m"])
    ring, line = figures[0].axes[0].lines
    assert line.get_xydata().tolist() == [[0, 0.9], [2, 0.7]] and ring.get_xydata().tolist() == [[2, 0.7]]
    assert dial.break_text("m") == "3 s"
    unknown = SweepReport("d", "meaning", "unit", "other", (1, 2, 3), cells, {"m": None})
    assert study.curves(unknown, ["m"]) is None and unknown.break_text("m") == "?"


def test_tables_show_the_mean_over_seeds_and_where_else_the_break_may_be():
    cells = tuple(Cell(value, "scene", 16, "m", {"q": quality, "p": 1.0}, None)
                  for value, quality in ((1, 0.9), (2, 0.8)))
    repeats = (Repeat(2, "m", (0.8, 0.6, None)),)
    dial = SweepReport("d", "meaning", "unit", "q", (1, 2), cells, {"m": Break(2, 0.7, "below bicubic", 1, 2)}, repeats)
    assert dial.series("m", "q") == [0.9, 0.7] and dial.series("m", "p") == [1, 1]
    assert dial.break_text("m") == "2 b (1 to 2)"
    for found, text in ((Break(2, 0.7, "below bicubic", 2, 2), "2 b"),
                        (Break(2, 0.7, "below its start", 2), "2 s (2 to ?)")):
        assert SweepReport("d", "", "", "q", (1, 2), cells, {"m": found}, repeats).break_text("m") == text
