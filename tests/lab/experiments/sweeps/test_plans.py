"""Plans at breaking points, on synthetic frames of one sweep."""

from __future__ import annotations

import dataclasses

import pytest

from lfsr_core.base.records import read_record, write_record
from lfsr_core.cli import main
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, FAST_METHOD
from lfsr_lab.experiments.engine.renders import Store
from lfsr_lab.experiments.engine.report import environment
from lfsr_lab.experiments.plan_validation.study import Validation
from lfsr_lab.experiments.sweeps import plans
from lfsr_lab.experiments.sweeps.measure import Scene
from lfsr_lab.experiments.sweeps.records import FORMAT, Break, Cell, Report, Settings, SweepReport
from lfsr_lab.experiments.sweeps.sweeps import choose_sweeps
from tests.support.noisy_renders import render
from tests.support.synthetic import MINI

METHODS = ("bicubic", FAST_METHOD, DEFAULT_METHOD)
SETTINGS = Settings(MINI, 4, 2048, 2)


def sweep_of(name="wire", first=0.62, **breaks):
    values = choose_sweeps([name])[0].values
    cells = tuple(Cell(value, f"{name}-{value:g}", 16, method, {"ssim_eia_fg": 0.8, "ssim_lens_fg": first}, None)
                  for value in values for method in METHODS)
    return SweepReport(name, "", "pixels", "ssim_eia_fg", values, cells, dict.fromkeys(METHODS) | breaks)


def test_plans_are_made_where_the_default_breaks_or_where_it_is_hardest():
    at = [Break(value, 0.7, "below its start") for value in (0.5, 0.25)]
    assert plans.value_of(sweep_of(**{DEFAULT_METHOD: at[0], FAST_METHOD: at[1]})) == 0.5
    assert plans.value_of(sweep_of(**{FAST_METHOD: at[1], "bicubic": at[0]})) == 0.25
    assert plans.value_of(sweep_of()) == 1 / 16
    assert plans.target_of(sweep_of(first=0.8)) == pytest.approx(0.75)
    assert plans.target_of(sweep_of(first=0.8199)) == pytest.approx(0.76)


def test_plans_at_a_breaking_point_are_made_judged_and_shown(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(plans, "SPPS", (4, 16))
    monkeypatch.setattr(plans, "SEEDS", (0,))
    wire = sweep_of(**{DEFAULT_METHOD: Break(0.5, 0.7, "below its start", 0.5, 0.25)})
    report = Report(FORMAT, SETTINGS, environment(), METHODS, (wire, sweep_of("motion")))
    write_record(tmp_path / "stress.json", report)
    scene = Scene(Store(tmp_path), SETTINGS, choose_sweeps(["wire"])[0], 0.5)
    jobs = [scene.reference_job, *plans.jobs_of(scene)]
    assert len(jobs) == 1 + 3 * 2
    for job in jobs:
        render(dataclasses.replace(job, seed=77 if job.kind == "reference" else 0))
    file = tmp_path / "plans.json"
    assert main(["study", "stress-plans", str(tmp_path), "-o", str(tmp_path / "out"), "--json", str(file)]) == 0
    found = read_record(file, Validation, "a validation").plans
    assert [(row.scene, row.target) for row in found] == [("wire-0.5", 0.57)]
    assert found[0].chosen and found[0].met and found[0].cost >= 0.9
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("| sweep | from – to | `bicubic` |")
    end = f"| 0.57 | 0.5 | {found[0].chosen} | 1/1 | {found[0].cost:.2f} |"
    assert lines[2].endswith(f"| 0.5 s (0.5 to 0.25) | .800 .800 .800 {end}")
    assert lines[3].endswith("| – | – | – | – | – |"), "no plan sees a motion"
