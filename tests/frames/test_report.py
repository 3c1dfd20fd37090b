"""report.json, also as earlier versions wrote it."""

from __future__ import annotations

import json

from lfsr_core.frames.report import Report, read_report, write_report

REPORT = Report("bicubic", "mini", 2, 16, {"render": 1.0}, None, 0.5)
SAMPLED = {"p": 0.5, "ssim_eia": 0.9, "ssim_eia_fg": 0.8, "psnr_fg": 30.0, "ssim_views_fg": None, "ssim_eia_plain": 0.7,
           "ssim_ceiling": 0.95, "flip": 0.1, "lenses": 12, "ci95": {"ssim_eia_fg": 0.05, "psnr_fg": 1.0}}


def with_metrics(folder, metrics):
    write_report(folder, REPORT)
    data = json.loads((folder / "report.json").read_text())
    (folder / "report.json").write_text(json.dumps(data | {"metrics": metrics}))
    return read_report(folder).metrics


def test_old_metrics_of_sampled_lenses_get_the_names_of_what_they_are(tmp_path):
    found = with_metrics(tmp_path, SAMPLED)
    assert (found["ssim_lens"], found["ssim_lens_fg"], found["ssim_lens_plain"]) == (0.9, 0.8, 0.7)
    assert found["ci95"] == {"ssim_lens_fg": 0.05, "psnr_fg": 1.0}
    assert not {"ssim_eia", "ssim_eia_fg", "ssim_eia_plain", "ssim_ceiling"} & set(found)
    assert with_metrics(tmp_path, found) == found, "a report of today is read as it is"


def test_metrics_of_a_whole_picture_keep_their_names(tmp_path):
    whole = {name: value for name, value in SAMPLED.items() if name not in ("lenses", "ci95")}
    assert with_metrics(tmp_path, whole) == whole
