"""`lfsr stress` on a bench folder whose renders are there: cells, tables, page, and what is refused.

No Blender: renders and references are synthetic, as other tests make them.
"""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest

from lfsr_core.base.records import read_record
from lfsr_core.cli import main
from lfsr_core.frames.frame import write_frame
from lfsr_core.reconstruct.methods import MethodName
from lfsr_lab.experiments.engine.records import Records
from lfsr_lab.experiments.engine.renders import SCENE_FILE
from lfsr_lab.experiments.plan_validation.study import Validation
from lfsr_lab.experiments.sweeps import measure, plans
from lfsr_lab.experiments.sweeps.records import Report
from lfsr_lab.experiments.sweeps.sweeps import SWEEPS as SWEEP_LIST
from lfsr_lab.experiments.sweeps.sweeps import choose_sweeps
from lfsr_lab.networks.methods import LabMethod
from tests.support.synthetic import fails, frame_of, write_reference, write_render

DOCUMENT = Path(__file__).parents[4] / "docs" / "notebook" / "stress.md"
TYPES = {"text": str, "integer": int, "number": (int, float), "array": list, "object": dict, "null": type(None)}
SWEEPS, FRAMES, SCALE = ("samples", "wire", "motion", "eye", "recall"), 2, 2
OPTIONS = ["--sweeps", ",".join(SWEEPS), "--methods", "bilinear,nearest", "--quick", "--display", "mini",
           "--scale", str(SCALE), "--reference-spp", "8", "--seeds", "2", "--frames", str(FRAMES)]


def fill(folder: Path) -> Path:
    """Every scene, reference and render that OPTIONS ask for."""
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
    return folder


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A finished bench folder."""
    folder = fill(tmp_path_factory.mktemp("bench"))
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


def test_the_report_is_as_documented(report):
    check(report, "stress.json")
    check(report["settings"], "settings")
    for dial in report["dials"]:
        check(dial, "dials")
        for cell in dial["cells"]:
            check(cell, "cells")
            check(cell["metrics"], "metrics", partly=True)
        for found in dial["breaks"].values():
            if found is not None:
                check(found, "breaks")
        for repeat in dial["repeats"]:
            check(repeat, "repeats")


def test_no_documented_metric_is_missing_everywhere(report):
    measured = {name for dial in report["dials"] for cell in dial["cells"] for name in cell["metrics"]}
    assert measured == set(documented("metrics"))


def test_every_method_is_measured_at_every_value(report):
    assert report["methods"] == ["bicubic", "bilinear", "nearest"]
    assert [dial["name"] for dial in report["dials"]] == list(SWEEPS)
    for dial in report["dials"]:
        pairs = [(cell["value"], cell["method"]) for cell in dial["cells"]]
        assert pairs == [(value, method) for value in dial["values"] for method in report["methods"]]
        assert set(dial["breaks"]) == set(report["methods"])
        assert all(dial["judged"] in cell["metrics"] for cell in dial["cells"])


def test_the_figures_are_those_of_the_method(report):
    cells = {cell["method"]: cell["metrics"] for cell in report["dials"][0]["cells"] if cell["value"] == 64}
    assert cells["nearest"]["ssim_eia_fg"] < cells["bicubic"]["ssim_eia_fg"] - 0.01
    assert cells["nearest"]["recall"] == 1 and 0 < cells["nearest"]["p"] < 1
    assert cells["nearest"]["neighbour_error"] > cells["bicubic"]["neighbour_error"]
    # All values show the same synthetic picture, so bicubic cannot break and the one below it breaks at once.
    assert report["dials"][0]["breaks"]["bicubic"] is None
    assert report["dials"][0]["breaks"]["nearest"]["value"] == 64


def test_values_near_breaking_points_have_every_seed(report):
    dials = {dial["name"]: dial for dial in report["dials"]}
    assert not dials["motion"]["repeats"], "its frames are of many seeds"
    for name, dial in dials.items():
        broken = [found["value"] for found in dial["breaks"].values() if found]
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


def test_equal_frames_at_rest_do_not_flicker(report):
    motion = next(dial for dial in report["dials"] if dial["name"] == "motion")
    still = next(cell for cell in motion["cells"] if cell["value"] == 0)
    assert (still["metrics"]["flicker_fixed"], still["metrics"]["steadiness"]) == (0, 1)


def test_the_table_shows_each_breaking_point(bench, report):
    text = (bench / "stress.md").read_text(encoding="utf-8")
    assert "| sweep | from – to | bicubic | bilinear | nearest |" in text
    row = next(line for line in text.splitlines() if line.startswith("| samples | 64 – 1 |"))
    assert row.endswith("| 64 b |") and "| – |" in row
    for dial in report["dials"]:
        assert f"\n## {dial['name']}\n" in text


def run_again(bench, monkeypatch) -> list[str]:
    """Names of the records that a second run measures."""
    made, real = [], Records.write
    monkeypatch.setattr(Records, "write", lambda records, name, *rest: made.append(name) or real(records, name, *rest))
    assert main(["study", "stress", "-o", str(bench), *OPTIONS]) == 0
    return made


def test_another_version_of_a_method_is_measured_again(bench, report, monkeypatch):
    versions = {"nearest": {"denoiser": -1}}
    with monkeypatch.context() as changed:
        changed.setattr(MethodName, "versions", property(lambda name: versions.get(name.text, {})))
        assert {name.split("-")[0] for name in run_again(bench, changed)} == {"nearest"}
    with monkeypatch.context() as changed:
        changed.setattr(LabMethod, "weights_digest", "others")
        repeated = sum(len(dial["repeats"]) for dial in report["dials"])
        assert len(run_again(bench, changed)) == 3 * (3 + 3 + 2 + 3 + 3) + repeated
        assert len(list(bench.glob("*/cells/*.json"))) == 3 * (3 + 3 + 2 + 3 + 3) + repeated


def test_the_published_report_is_what_the_documents_show():
    results = DOCUMENT.parents[1] / "results"
    published = read_record(results / "measured" / "stress.json", Report, "a report of the sweeps")
    assert [dial.name for dial in published.sweeps] == [sweep.name for sweep in SWEEP_LIST]
    document = DOCUMENT.read_text(encoding="utf-8")
    for dial in published.sweeps:
        assert " | ".join(["", *map(dial.break_text, published.methods)]) in document
        figures = [f"{dial.series(method, dial.judged)[0]:.3f}" for method in published.methods]
        assert " | ".join([f"\n| {dial.values[0]:g}", *figures]) in document
    made = read_record(results / "measured" / "plan-stress.json", Validation, "a validation of plans")
    assert "\n".join(plans.table(published, made.plans)) in (results / "stress.md").read_text(encoding="utf-8")


def test_default_methods_are_bicubic_the_default_and_what_has_weights():
    methods = measure.default_methods(4)
    assert methods[0] == "bicubic" and measure.DEFAULT_METHOD in methods
    assert "espcn" in methods and "paper-3" not in methods
    assert "espcn" not in measure.default_methods(2)
    for name in methods:
        LabMethod.parse(name)
    assert len(set(methods)) == len(methods)


@pytest.mark.parametrize(("options", "message"), [
    (["--sweeps", "wires"], "did you mean 'wire'"), (["--methods", "bicubix"], "did you mean 'bicubic'"),
    (["--scale", "3"], "scale is 3"), (["--scale", "1"], "scale is 1"), (["--frames", "1"], "need at least 2"),
    (["--display", "minni"], "did you mean 'mini'"),
    (["--display", "looking-glass-go", "--scale", "2", "--methods", "paper"], "'paper' needs views in two directions")])
def test_bad_input_is_refused_before_anything_is_written(tmp_path, capsys, options, message):
    assert message in fails(["study", "stress", "-o", str(tmp_path / "out"), "--display", "mini", *options], capsys)
    assert not (tmp_path / "out").exists()


def test_a_folder_of_other_settings_is_refused(bench, capsys):
    changed = [*OPTIONS[:-1], "3"]
    assert "frames differs" in fails(["study", "stress", "-o", str(bench), *changed], capsys)
