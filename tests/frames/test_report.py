"""report.json keeps the keys that scripts know."""

from __future__ import annotations

import json

from lfsr_core.frames.report import Report, read_report, write_report


def test_a_report_comes_back_and_its_keys_stay(tmp_path):
    report = Report("bicubic", "mini", 2, 16, {"render": 1.0}, None, 0.5, metrics={"p": 0.5}, temporal_averaging=2)
    write_report(tmp_path, report)
    assert read_report(tmp_path) == report
    data = json.loads((tmp_path / "report.json").read_text())
    assert (data["foreground_share"], data["share_frames"]) == (0.5, 2)
