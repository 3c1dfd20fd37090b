"""report.json, by the names of its fields."""

import json

from lfsr_core.base.notices import Notice
from lfsr_core.frames.finish import Finish, Report, read_report, write_report


def test_a_report_comes_back(tmp_path):
    report = Report(Finish("bicubic", temporal_averaging=2), "bicubic", "mini", 2, 16, {"render": 1.0}, None, 0.5,
                    (Notice("scale-unseen", {"scale": 2}),), metrics={"p": 0.5})
    write_report(tmp_path, report)
    assert read_report(tmp_path) == report
    data = json.loads((tmp_path / "report.json").read_text())
    assert (data["foreground_fraction"], data["finish"]["temporal_averaging"]) == (0.5, 2)
