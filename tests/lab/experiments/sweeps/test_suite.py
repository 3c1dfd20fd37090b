"""`lfsr stress` on a bench folder of synthetic renders, without Blender: cells, tables, page, and what is refused."""

import dataclasses
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.base.records import read_record, write_record
from lfsr_core.cli import main
from lfsr_core.frames.frame import write_frame
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, FAST_METHOD, MethodName
from lfsr_lab.experiments.engine.records import SCENE_FILE, Records, Store
from lfsr_lab.experiments.engine.report import environment
from lfsr_lab.experiments.plan_validation.study import Validation
from lfsr_lab.experiments.sweeps import measure, plans, records, study
from lfsr_lab.experiments.sweeps.measure import Scene
from lfsr_lab.experiments.sweeps.records import FORMAT, Break, Cell, Report, Settings, SweepReport, choose_sweeps
from lfsr_lab.experiments.sweeps.records import SWEEPS as SWEEP_LIST
from lfsr_lab.networks.methods import LabMethod
from tests.support.noisy_renders import render
from tests.support.synthetic import MINI, fails, frame_of, write_reference, write_render

qualities = st.lists(st.floats(0, 1), min_size=1, max_size=9)


def once(figures):
    """Figures of one seed by value."""
    return {value: [figure] for value, figure in (figures.items() if isinstance(figures, dict) else enumerate(figures))}


@given(qualities, qualities)
def test_what_breaks_is_broken_and_nothing_before_it_is(values, bicubic):
    def broken(index):
        rival = bicubic[index] if index < len(bicubic) else -1
        return values[index] - rival + 1e-9 <= 0 or values[index] - values[0] + (0.05 - 1e-9) <= 0

    point = records.breaking_point(range(len(values)), once(values), once(bicubic))
    assert (point.value if point else None) == next((index for index in range(len(values)) if broken(index)), None)
    assert point is None or point.earliest is point.latest is None, "one seed tells nothing of the noise"


@given(st.floats(0.06, 1))
def test_the_threshold_itself_counts_as_below_the_start_but_not_as_below_bicubic(start):
    point = records.breaking_point([8, 4], once({8: start, 4: start - 0.05}))
    assert point == records.Break(4, start - 0.05, records.BELOW_START)
    assert records.breaking_point([8, 4], once({8: start, 4: start - 0.0499})) is None
    assert records.breaking_point([8, 4], once({8: start, 4: start}), once({8: start, 4: start})) is None
    point = records.breaking_point([8, 4], once({8: start, 4: start}), once({8: start, 4: start + 1e-6}))
    assert point.reason == records.BELOW_BICUBIC


def test_the_first_value_in_the_sweeps_order_counts_and_values_that_cannot_be_told_are_passed_over():
    assert records.breaking_point([64, 16, 1], once({64: 0.9, 16: 0.8, 1: 0.7})).value == 16
    point = records.breaking_point([1, 2, 3], once({1: None, 2: 0.9, 3: 0.8}), once({1: 1.0, 2: None, 3: None}))
    assert point.value == 3 and records.breaking_point([1, 2], once({1: None, 2: None})) is None
    assert records.breaking_point([1, 2], {}) is None


def test_noise_widens_where_a_method_may_break_and_pairs_of_seeds_cancel_it():
    noise = np.random.default_rng(1).normal(0, 0.02, (10, 4))
    bicubic = {value: list(0.8 + noise[:, value]) for value in range(4)}
    margin = {0: 0.05, 1: 0.02, 2: -0.001, 3: -0.05}
    paired = {value: list(0.8 + noise[:, value] + margin[value]) for value in range(4)}
    point = records.breaking_point(range(4), paired, bicubic)
    assert (point.value, point.reason, point.earliest, point.latest) == (2, records.BELOW_BICUBIC, 2, 2)
    alone = {value: list(np.roll(paired[value], 1)) for value in range(4)}  # the same figures, other pairs
    point = records.breaking_point(range(4), alone, bicubic)
    assert (point.value, point.latest) == (2, 3), "at 2 it is below on the mean, but that may be noise"
    point = records.breaking_point([0, 1], {0: [0.9] * 4, 1: [0.8, 0.9, 0.8, 0.88]})  # no value makes it sure
    assert (point.value, point.reason, point.earliest, point.latest) == (1, records.BELOW_START, 1, None)


def test_every_sweep_is_whole_and_only_values_of_samples_share_a_scene():
    assert len({sweep.name for sweep in records.SWEEPS}) == len(records.SWEEPS)
    for sweep in records.SWEEPS:
        assert set(sweep.quick) <= set(sweep.values) and len(set(sweep.values)) == len(sweep.values) > 2
        assert list(sweep.quick) == [value for value in sweep.values if value in sweep.quick]
        assert sweep.values[0] == sweep.quick[0], "both start alike"
        ordered = sorted(sweep.values)
        assert list(sweep.values) in (ordered, ordered[::-1]), "one direction from easy to hard"
    names = [sweep.scene_name(value) for sweep in records.SWEEPS for value in sweep.values]
    assert len(set(names)) == len(names) - 6
    (samples,), (wire,) = records.choose_sweeps(["samples"]), records.choose_sweeps(["wire"])
    assert samples.samples(4) == 4 and wire.samples(0.25) == 16
    assert [sweep.name for sweep in records.choose_sweeps(["wire", "samples"])] == ["samples", "wire"]
    assert records.choose_sweeps(None) == records.SWEEPS


def report_of(judged, qualities, point, repeats=(), **more):
    """A sweep of one method with these qualities at 1, 2, …; ``more``: metrics of every cell."""
    values = tuple(range(1, len(qualities) + 1))
    cells = tuple(records.Cell(value, "scene", 16, "m", {"q": quality, **more}, None)
                  for value, quality in zip(values, qualities, strict=True))
    return records.SweepReport("d", "meaning", "unit", judged, values, cells, {"m": point}, repeats)


def test_a_curve_with_gaps_is_drawn_where_it_is_known_and_tables_show_means_over_seeds(monkeypatch):
    sweep, figures = report_of("q", (0.9, None, 0.7), records.Break(3, 0.7, records.BELOW_START)), []
    monkeypatch.setattr(study, "svg", lambda figure: figures.append(figure) or "<svg></svg>")
    study.curves(sweep, ["m"])
    ring, line = figures[0].axes[0].lines
    assert line.get_xydata().tolist() == [[0, 0.9], [2, 0.7]] and ring.get_xydata().tolist() == [[2, 0.7]]
    unknown = report_of("other", (0.9, None, 0.7), None)
    assert study.curves(unknown, ["m"]) is None and unknown.break_text("m") == "?"
    repeats = (records.Repeat(2, "m", (0.8, 0.6, None)),)
    below, start = records.BELOW_BICUBIC, records.BELOW_START
    for details, text in (((below, 1, 2), "2 b (1 to 2)"), ((below, 2, 2), "2 b"), ((start, 2), "2 s (2 to ?)"),
                          ((start,), "2 s")):
        sweep = report_of("q", (0.9, 0.8), records.Break(2, 0.7, *details), repeats, p=1.0)
        assert sweep.break_text("m") == text
    assert sweep.series("m", "q") == [0.9, 0.7] and sweep.series("m", "p") == [1, 1]


DOCUMENT = Path(__file__).parents[4] / "docs" / "notebook" / "stress.md"
TYPES = {"text": str, "integer": int, "number": (int, float), "array": list, "object": dict, "null": type(None)}
SWEEPS, FRAMES, SCALE = ("samples", "wire", "motion", "eye", "recall"), 2, 2
OPTIONS = ["--sweeps", ",".join(SWEEPS), "--methods", "bilinear,nearest", "--quick", "--display", "mini",
           "--scale", str(SCALE), "--reference-spp", "8", "--seeds", "2", "--frames", str(FRAMES)]


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A finished bench folder, with every scene, reference and render that OPTIONS ask for."""
    folder = tmp_path_factory.mktemp("bench")
    source = write_render(folder / "source" / "low"), write_reference(folder / "source" / "reference")
    for sweep in choose_sweeps(SWEEPS):
        for value in sweep.quick:
            scene = folder / sweep.scene_name(value)
            scene.mkdir(exist_ok=True)
            (scene / SCENE_FILE).touch()
            shutil.copytree(source[1], scene / "reference", dirs_exist_ok=True)
            names = [f"s{SCALE}-spp{sweep.samples(value)}"]
            frames = ((1, 1), (2, 0), (2, 2)) if sweep.name == "motion" else ((1, 1),)
            names += [f"{names[0]}-frame{frame}-seed{seed}" for frame, seed in frames]
            for name in names:
                shutil.copytree(source[0], scene / name, dirs_exist_ok=True)
                write_frame(scene / name, frame_of(SCALE, samples=sweep.samples(value)))
    assert main(["study", "stress", "-o", str(folder), *OPTIONS]) == 0
    return folder


@pytest.fixture(scope="module")
def report(bench):
    return json.loads((bench / "stress.json").read_text(encoding="utf-8"))


def documented(section: str) -> dict[str, tuple[str, ...]]:
    """Key -> names of allowed types, from the table of one section."""
    text = DOCUMENT.read_text(encoding="utf-8").split(f"\n### {section}\n")[1].split("\n## ")[0].split("\n### ")[0]
    return {key: tuple(types.split(" or ")) for key, types in re.findall(r"^\| `(\w+)` \| ([\w ]+) \|", text, re.M)}


def check(data, section, partly=False):
    table = documented(section)
    assert (set(data) <= set(table)) if partly else (set(data) == set(table)), set(data) ^ set(table)
    for key, value in data.items():
        assert any(isinstance(value, TYPES[name]) for name in table[key]), (key, value)


def test_the_report_is_as_documented_and_has_every_method_at_every_value(report):
    check(report, "stress.json")
    check(report["settings"], "settings")
    assert report["methods"] == ["bicubic", "bilinear", "nearest"]
    assert [dial["name"] for dial in report["dials"]] == list(SWEEPS)
    for dial in report["dials"]:
        check(dial, "dials")
        for cell in dial["cells"]:
            check(cell, "cells")
            check(cell["metrics"], "metrics", partly=True)
        for point in filter(None, dial["breaks"].values()):
            check(point, "breaks")
        for repeat in dial["repeats"]:
            check(repeat, "repeats")
        pairs = [(cell["value"], cell["method"]) for cell in dial["cells"]]
        assert pairs == [(value, method) for value in dial["values"] for method in report["methods"]]
        assert set(dial["breaks"]) == set(report["methods"])
        assert all(dial["judged"] in cell["metrics"] for cell in dial["cells"])
    measured = {name for dial in report["dials"] for cell in dial["cells"] for name in cell["metrics"]}
    assert measured == set(documented("metrics")), "no metric is missing everywhere"


def test_the_figures_are_those_of_the_method_and_the_table_shows_each_breaking_point(bench, report):
    cells = {cell["method"]: cell["metrics"] for cell in report["dials"][0]["cells"] if cell["value"] == 64}
    assert cells["nearest"]["ssim_eia_fg"] < cells["bicubic"]["ssim_eia_fg"] - 0.01
    assert cells["nearest"]["recall"] == 1 and 0 < cells["nearest"]["p"] < 1
    assert cells["nearest"]["neighbour_error"] > cells["bicubic"]["neighbour_error"]
    # All values show the same synthetic picture, so bicubic cannot break and the one below it breaks at once.
    assert report["dials"][0]["breaks"]["bicubic"] is None and report["dials"][0]["breaks"]["nearest"]["value"] == 64
    motion = next(dial for dial in report["dials"] if dial["name"] == "motion")
    still = next(cell for cell in motion["cells"] if cell["value"] == 0)
    assert (still["metrics"]["flicker_fixed"], still["metrics"]["steadiness"]) == (0, 1), "its frames are the same"
    text = (bench / "stress.md").read_text(encoding="utf-8")
    assert "| sweep | from – to | bicubic | bilinear | nearest |" in text
    row = next(line for line in text.splitlines() if line.startswith("| samples | 64 – 1 |"))
    assert row.endswith("| 64 b |") and "| – |" in row
    assert all(f"\n## {dial['name']}\n" in text for dial in report["dials"])


def test_values_near_breaking_points_have_every_seed(report):
    dials = {dial["name"]: dial for dial in report["dials"]}
    assert not dials["motion"]["repeats"], "its frames are of many seeds"
    for name, dial in dials.items():
        broken = [point["value"] for point in dial["breaks"].values() if point]
        if name == "motion" or not broken:
            continue
        repeated = {repeat["value"] for repeat in dial["repeats"]}
        assert {*broken, dial["values"][0]} <= repeated
        assert len(dial["repeats"]) == len(repeated) * len(report["methods"])
        for repeat in dial["repeats"]:
            assert len(repeat["figures"]) == 2
            first = next(cell for cell in dial["cells"] if (cell["value"], cell["method"]) ==
                         (repeat["value"], repeat["method"]))
            # The synthetic renders of both seeds are the same, and both ways of measuring agree.
            assert repeat["figures"] == pytest.approx([first["metrics"][dial["judged"]]] * 2, abs=1e-12)
    assert dials["samples"]["breaks"]["nearest"]["earliest"] == dials["samples"]["breaks"]["nearest"]["latest"] == 64


def test_another_version_of_a_method_is_measured_again_and_a_folder_of_other_settings_refused(bench, report,
                                                                                              monkeypatch, capsys):
    made, real, versions = [], Records.write, {"nearest": {"denoiser": -1}}
    monkeypatch.setattr(Records, "write", lambda records, name, *rest: made.append(name) or real(records, name, *rest))
    monkeypatch.setattr(MethodName, "versions", property(lambda name: versions.get(name.text, {})))
    assert main(["study", "stress", "-o", str(bench), *OPTIONS]) == 0
    assert {name.split("-")[0] for name in made} == {"nearest"}
    cells = 3 * (3 + 3 + 2 + 3 + 3) + sum(len(dial["repeats"]) for dial in report["dials"])
    kept = [json.loads(path.read_text()) for path in bench.glob("*/cells/*.json")]
    assert len(kept) == cells and all(cell["fingerprint"].keys() == {"weights", "versions"} for cell in kept)
    capsys.readouterr()
    assert "frames differs" in fails(["study", "stress", "-o", str(bench), *OPTIONS[:-1], "3"], capsys)


def test_the_published_report_is_what_the_documents_show():
    results = DOCUMENT.parents[1] / "results"
    published = read_record(results / "measured" / "stress.json", Report, "a report of the sweeps")
    assert [dial.name for dial in published.sweeps] == [sweep.name for sweep in SWEEP_LIST]
    document = DOCUMENT.read_text(encoding="utf-8")
    for dial in published.sweeps:
        assert " | ".join(["", *map(dial.break_text, published.methods)]) in document
        figures = [f"{dial.series(method, dial.judged)[0]:.3f}" for method in published.methods]
        assert " | ".join([f"\n| {dial.values[0]:g}", *figures]) in document


@pytest.mark.parametrize(("options", "message"), [
    (["--sweeps", "wires"], "did you mean 'wire'"), (["--methods", "bicubix"], "did you mean 'bicubic'"),
    (["--scale", "3"], "scale is 3"), (["--scale", "1"], "scale is 1"), (["--frames", "0"], "need at least 2"),
    (["--display", "minni"], "did you mean 'mini'"), (["--seeds", "0"], "--seeds is 0"),
    (["--reference-spp", "0"], "has 0 samples"),
    (["--display", "looking-glass-go", "--scale", "2", "--methods", "paper"], "'paper' needs views in two directions")])
def test_bad_input_is_refused_before_anything_is_written(tmp_path, capsys, options, message):
    assert message in fails(["study", "stress", "-o", str(tmp_path / "out"), "--display", "mini", *options], capsys)
    assert not (tmp_path / "out").exists()


METHODS = ("bicubic", FAST_METHOD, DEFAULT_METHOD)
SETTINGS = Settings(MINI, 4, 2048, 2)


def sweep_of(name="wire", first=0.62, **breaks):
    values = choose_sweeps([name])[0].values
    cells = tuple(Cell(value, f"{name}-{value:g}", 16, method, {"ssim_eia_fg": 0.8, "ssim_lens_fg": first}, None)
                  for value in values for method in METHODS)
    return SweepReport(name, "", "pixels", "ssim_eia_fg", values, cells, dict.fromkeys(METHODS) | breaks)


def test_plans_are_made_where_the_default_breaks_or_where_it_is_hardest_and_default_methods_have_weights():
    at = [Break(value, 0.7, "below its start") for value in (0.5, 0.25)]
    assert plans.value_of(sweep_of(**{DEFAULT_METHOD: at[0], FAST_METHOD: at[1]})) == 0.5
    assert plans.value_of(sweep_of(**{FAST_METHOD: at[1], "bicubic": at[0]})) == 0.25
    assert plans.value_of(sweep_of()) == 1 / 16 and plans.target_of(sweep_of(first=0.8)) == pytest.approx(0.75)
    assert plans.target_of(sweep_of(first=0.8199)) == pytest.approx(0.76)
    methods = measure.default_methods(4)
    assert methods[0] == "bicubic" and measure.DEFAULT_METHOD in methods
    assert "espcn" in methods and "paper-3" not in methods
    assert "espcn" not in measure.default_methods(2)
    for name in methods:
        LabMethod.parse(name)
    assert len(set(methods)) == len(methods)


def test_plans_at_a_breaking_point_are_made_judged_and_shown(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(plans, "SPPS", (4, 16))
    monkeypatch.setattr(plans, "SEEDS", (0,))
    wire = sweep_of(**{DEFAULT_METHOD: Break(0.5, 0.7, "below its start", 0.5, 0.25)})
    write_record(tmp_path / "stress.json", Report(FORMAT, SETTINGS, environment(), METHODS, (wire, sweep_of("motion"))))
    scene = Scene(Store(tmp_path), SETTINGS, choose_sweeps(["wire"])[0], 0.5)
    jobs = [scene.reference_job, *plans.jobs_of(scene)]
    assert len(jobs) == 1 + 3 * 2
    for job in jobs:
        render(dataclasses.replace(job, seed=77 if job.kind == "reference" else 0))
    file = tmp_path / "plans.json"
    assert main(["study", "stress-plans", str(tmp_path), "-o", str(tmp_path / "out"), "--json", str(file)]) == 0
    rows = read_record(file, Validation, "a validation").plans
    assert [(row.scene, row.target) for row in rows] == [("wire-0.5", 0.57)]
    assert rows[0].chosen and rows[0].met and rows[0].cost >= 0.9
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("| sweep | from – to | `bicubic` |")
    end = f"| 0.57 | 0.5 | {rows[0].chosen} | 1/1 | {rows[0].cost:.2f} |"
    assert lines[2].endswith(f"| 0.5 s (0.5 to 0.25) | .800 .800 .800 {end}")
    assert lines[3].endswith("| – | – | – | – | – |"), "no plan sees a motion"
