"""The report of a plan: its table and its file."""

from __future__ import annotations

import pytest

from lfsr_core.base.records import read_record, write_record
from lfsr_core.plan import score
from lfsr_core.plan.options import PlanOptions
from lfsr_core.plan.planner import make_plan
from lfsr_core.plan.report import PlanReport, _front, plan_report, table
from tests.support.noisy_renders import JOB, render


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """The quick look without a denoiser, which takes longer than all else here."""
    monkeypatch.setattr(score, "is_available", lambda: False)


def test_report_says_everything(tmp_path):
    options = PlanOptions(target=0.6, scales=(2, 4), spps=(4, 16, 64), methods=("nearest", "bilinear"), lenses=40,
                      reference_spp=1024, between=0)
    planned = make_plan(JOB, options, lambda job, progress: render(job), tmp_path / "sample")
    text = table(planned, options, JOB.display)
    chosen = planned.choice.chosen
    assert any(line.startswith("→") and chosen.candidate.method in line for line in text.splitlines())
    assert "path samples of s2-spp64" in text and "with 95 % confidence" in text
    report = plan_report(planned, options, JOB)
    write_record(tmp_path / "plan.json", report)
    assert read_record(tmp_path / "plan.json", PlanReport, "a plan") == report
    assert report.chosen.method == chosen.candidate.method and len(report.candidates) == 12
    assert report.sample.lenses["foreground"] + report.sample.lenses["edge"] == 40
    assert report.sample.cost_ratio >= 1 and report.sample.costliest.startswith("s2-spp64")
    assert text == table(planned, options, JOB.display, details=True)
    short = table(planned, options, JOB.display, details=False).splitlines()
    assert len(short) <= 9, "ten with the command to render"
    assert any(line.startswith("→") and chosen.candidate.method in line for line in short)
    assert short[-2:] == text.splitlines()[-2:]
    lows = [row.estimate.low for row in _front(list(planned.rated), planned.choice) if row.estimate]
    assert lows == sorted(set(lows)), "nothing is shown that a cheaper one equals"
