"""The validation of plans, on a bench folder of synthetic frames: replayed samples, whole frames, verdicts."""

import dataclasses
import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from lfsr_core.base.messages import Notice
from lfsr_core.base.records import read_record
from lfsr_core.cli import main
from lfsr_core.frames.frame import LOW_RES_FILE, REFERENCE_FILES, Sampling, read_frame, write_frame
from lfsr_core.images.image_files import read_layers
from lfsr_core.optics.rays import to_elemental_images
from lfsr_core.plan.options import Candidate, Choice, Estimate, PlanOptions, Rated, path_samples
from lfsr_core.plan.planner import Planned, SampleFacts
from lfsr_lab.experiments.engine.records import Records
from lfsr_lab.experiments.plan_validation import study
from lfsr_lab.experiments.plan_validation.study import Actual, Validation, judge, summary, wilson
from tests.support.noisy_renders import JOB, render
from tests.support.synthetic import MINI, fails, write_render

RENDERS = [(2, 4), (2, 16), (2, 64), (4, 4), (4, 16)]


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A bench of one scene."""
    folder = tmp_path_factory.mktemp("bench")
    for scale, spp in RENDERS:
        name = str(folder / "toy" / f"s{scale}-spp{spp}")
        render(dataclasses.replace(JOB, output=name, sampling=Sampling(scale, spp), seed=0))
    render(dataclasses.replace(JOB, output=str(folder / "toy" / "reference"), kind="reference",
                               sampling=Sampling(1, 2048), seed=77))
    return folder


def test_scenes_and_renders_are_found_and_replay_cuts_the_lenses_out_of_the_frame(bench, tmp_path):
    (scene,) = study.scenes(bench)
    assert scene.name == "toy" and sorted(study.renders(scene)) == RENDERS
    lenses = ((2, 3), (5, 5), (6, 9), (7, 1), (11, 15))
    job = dataclasses.replace(JOB, output=str(tmp_path / "cut"), sampling=Sampling(2, 16), lens_list=lenses)
    study.replay(bench / "toy", job)
    frame = read_frame(tmp_path / "cut")
    cut = to_elemental_images(read_layers(tmp_path / "cut" / LOW_RES_FILE)["color"], frame.rays.tiles)
    whole = to_elemental_images(read_layers(bench / "toy" / "s2-spp16" / LOW_RES_FILE)["color"], MINI.lenses)
    for number, lens in enumerate(lenses):
        assert np.array_equal(cut[number // cut.shape[1], number % cut.shape[1]], whole[lens])


def test_replayed_references_show_both_halves_and_the_setup_is_what_no_sample_costs(bench, tmp_path):
    halves = set()
    for part in (0, 1):
        job = dataclasses.replace(JOB, output=str(tmp_path / f"{part}"), kind="reference", sampling=Sampling(1),
                                  seed=JOB.seed + part, lens_list=((5, 8), (6, 9)))
        study.replay(bench / "toy", job)
        parts = [read_layers(tmp_path / f"{part}" / name)["color"].tobytes() for name in REFERENCE_FILES]
        assert parts[0] == parts[1]
        halves.add(parts[0])
    assert len(halves) == 2
    for scale, spp in ((4, 4), (4, 16), (2, 16)):
        folder = write_render(tmp_path / f"s{scale}-spp{spp}", scale, samples=spp)
        frame = read_frame(folder)
        write_frame(folder, dataclasses.replace(frame, seconds={"render": 0.7 + 1e-5 * path_samples(frame)}))
    assert math.isclose(study.setup_seconds(tmp_path), 0.7, rel_tol=1e-6)


def test_plans_are_held_against_whole_frames(bench, tmp_path, capsys):
    words = (f"study plans {bench} -o {tmp_path}/out --json {tmp_path}/plans.json --replay --methods nearest,bilinear "
             "--lenses 40").split()
    assert main([*words, "--seeds", "0-3", "--targets", "0.5,0.6,0.9"]) == 0
    data = read_record(tmp_path / "plans.json", Validation, "a validation")
    rows, whole = data.plans, data.summary
    assert len(rows) == 12 and whole == summary(rows)
    assert all(row.chosen is None and row.hindsight is None for row in rows if row.target == 0.9)
    assert whole.met == 1 and whole.bounds_below_actual > 0.9
    assert abs(whole.mean_error) < 0.01
    said = capsys.readouterr().out
    assert "| toy | 0 | 0.500 | s2" in said
    first = rows[0]
    assert len(first.measured) == len(first.actuals) == len(first.errors) > 4
    actual_of = dict(zip(first.measured, first.actuals, strict=True))
    assert f"| toy | s4-spp16 bilinear | {actual_of['s4-spp16 bilinear']:.3f} | " in said
    # What was measured is kept: a second time nothing is finished again.
    kept = sorted((tmp_path / "out" / "toy" / "truth").iterdir())
    assert len(kept) == 8
    times = [path.stat().st_mtime_ns for path in kept]
    assert main([*words, "--seeds", "1", "--targets", "0.5"]) == 0
    assert [path.stat().st_mtime_ns for path in kept] == times


def test_a_plan_that_promises_too_much_is_found_out():
    cheap, costly = Candidate(4, 4, "bilinear"), Candidate(4, 16, "bilinear")
    rows = (Rated(**vars(cheap), seconds=1.0, estimate=Estimate(0.96, 0.95, 30)),
            Rated(**vars(costly), seconds=4.0, estimate=Estimate(0.97, 0.96, 30)))
    sample = SampleFacts(30, 90, "s1-spp16 oidn", 100.0, 4.0, 1.0, 0.04)
    actuals = {cheap: Actual(0.94, 1.1), costly: Actual(0.965, 4.4)}

    def planned(rows, choice, sample):
        return Planned("toy.blend", "mini", 0, PlanOptions(), sample, rows, choice)
    wrong = judge(planned(rows, Choice(rows[0], rows[1]), sample), actuals, MINI, "toy", 0, 0.95)
    assert wrong.met is False and wrong.cost is None and wrong.hindsight == costly.name
    assert wrong.covered == (False, True)
    wasteful = judge(planned(rows, Choice(rows[1], rows[1]), sample), actuals, MINI, "toy", 0, 0.93)
    assert wasteful.met is True and wasteful.cost == pytest.approx(4) == wasteful.samples
    limit = Notice("plan-limit-noise", {"samples": 16})
    nothing = judge(planned(rows, Choice(None, rows[1], limit), sample), actuals, MINI, "toy", 0, 0.95)
    totals = summary([wrong, wasteful, nothing])
    assert (totals.met, totals.nothing_chosen_though_possible, totals.cheap_enough) == (0.5, 1, 0.0)
    assert totals.bounds_below_actual == 0.5 and math.isclose(totals.mean_share_of_seconds, 0.04)


def test_with_a_rate_a_busy_machine_changes_nothing(bench, tmp_path):
    scene, job = bench / "toy", dataclasses.replace(JOB, output=str(tmp_path / "cut"), sampling=Sampling(2, 16),
                                                    lens_list=((2, 3), (5, 5)))
    busy = shutil.copytree(scene, tmp_path / "busy")
    for folder in busy.iterdir():
        frame = read_frame(folder)
        write_frame(folder, dataclasses.replace(frame, seconds={**frame.seconds, "render": 7.0}))
    assert study.timed_frame(busy / "s2-spp16", 0.01).seconds["render"] == pytest.approx(
        0.01 * path_samples(read_frame(busy / "s2-spp16")))
    study.replay(busy, job, 0.01)
    cut = read_frame(tmp_path / "cut")
    assert cut.seconds["render"] == pytest.approx(0.01 * path_samples(cut))
    (actual,) = study.actuals(busy, [Candidate(2, 16, "bilinear")], Records(tmp_path, Actual), 1000).values()
    assert actual.seconds == pytest.approx(1000 * path_samples(read_frame(busy / "s2-spp16")), rel=1e-3)


@pytest.mark.parametrize(("true", "count", "expected"), [
    (35, 36, (0.8583, 0.9951)), (0, 10, (0.0, 0.2775)), (10, 10, (0.7225, 1.0)), (0, 0, None)])
def test_intervals_of_fractions_are_wilsons(true, count, expected):
    assert wilson([index < true for index in range(count)]) == (expected and pytest.approx(expected, abs=1e-4))


def test_a_bench_without_scenes_is_refused_and_published_validations_are_read(tmp_path, capsys):
    words = ["study", "plans", str(tmp_path), "-o", str(tmp_path), "--json", str(tmp_path / "x.json"), "--replay"]
    assert "has no scene" in fails(words, capsys)
    for name in ("plan-unseen", "plan-stress", "plan-lenticular"):
        published = Path(__file__).parents[4] / "docs" / "results" / "measured" / f"{name}.json"
        assert read_record(published, Validation, "a validation").plans
