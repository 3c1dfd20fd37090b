"""``lfsr compare`` from its arguments to its table."""

import contextlib
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lfsr_core.cli import build_parser, main
from lfsr_core.commands import common
from lfsr_core.frames.frame import samples_at
from lfsr_core.metrics.eia_metrics import METRIC_NAMES, SAMPLED_NAMES
from lfsr_core.optics.display import load_display
from lfsr_core.plan.options import PlanOptions
from lfsr_core.plan.planner import work_folder
from tests.support.played_blender import ROOT
from tests.support.requests import make_request
from tests.support.synthetic import fails, write_reference, write_render


@pytest.mark.parametrize("lenses", [None, tuple((row, column) for row in range(3, 9) for column in range(4, 12))])
def test_compare_writes_and_prints_every_metric_also_in_a_python_without_flip(tmp_path, capsys, lenses):
    """A Python that has no flip-evaluator, as Blender's, compares all the same."""
    folder, reference = write_render(tmp_path / "frame"), write_reference(tmp_path / "reference", lens_list=lenses)
    main(["upscale", str(folder), "--method", "bicubic"])
    capsys.readouterr()
    assert main(["compare", str(folder), str(reference)]) == 0
    printed, metrics = capsys.readouterr().out, json.loads((folder / "report.json").read_text())["metrics"]
    names = METRIC_NAMES if lenses is None else SAMPLED_NAMES
    assert set(names) <= set(metrics)
    for name in names:
        assert (name in printed.split()) == (metrics[name] is not None)
    part = "eia" if lenses is None else "lens"
    assert 1 > metrics[f"ssim_{part}"] > metrics[f"ssim_{part}_fg"] > 0.5, "the background is easy"
    assert ("±" in printed) == (lenses is not None)
    source = ("import sys; sys.modules['flip_evaluator'] = None; from lfsr_core.cli import main; "
              f"sys.exit(main(['compare', {str(folder)!r}, {str(reference)!r}]))")
    done = subprocess.run([sys.executable, "-c", source], capture_output=True, text=True, check=True)
    assert "FLIP was not computed" in done.stdout and "flip  " not in done.stdout
    without = json.loads((folder / "report.json").read_text())["metrics"]
    assert without["flip"] is None and without["notes"] == [{"code": "flip-missing", "values": {}}]
    left_out = ("flip", "notes", "ci95")
    assert {name: without[name] for name in without if name not in left_out} == {
        name: metrics[name] for name in metrics if name not in left_out}


def test_compare_before_upscale_or_with_a_frame_instead_of_a_reference_is_refused(tmp_path, capsys):
    folder, reference = write_render(tmp_path / "frame"), write_reference(tmp_path / "reference")
    assert "report.json does not exist" in fails(["compare", str(folder), str(reference)], capsys)
    main(["upscale", str(folder), "--method", "nearest"])
    capsys.readouterr()
    assert "scale 2" in fails(["compare", str(folder), str(folder)], capsys)
    assert json.loads((folder / "report.json").read_text())["metrics"] == {}
    for number, lenses in enumerate((((5, 7),), ((0, 0),), ((5, 7), (5, 8)))):
        reference = write_reference(tmp_path / f"few{number}", lens_list=lenses)
        assert main(["compare", str(folder), str(reference)]) == 0
        printed = capsys.readouterr().out
        assert printed.startswith("p ") and "None" not in printed, "of very few lenses it tells what it can"


FEW = ["--display", "mini", "--scales", "2", "--spps", "4", "--methods", "nearest,bilinear", "--lenses", "24",
       "--reference-spp", "256"]

@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "lfsr" / "plans"


def test_plan_ends_with_the_command_that_renders_the_choice(scene, blender, tmp_path, capsys):
    assert main(["plan", scene, "--target", "0.5", *FEW, "--frame", "3", "--no-world-visible", "--blender", blender,
                 "--json", "--work", str(tmp_path / "work")]) == 0
    said = capsys.readouterr()
    words, data = shlex.split(said.err.splitlines()[-1]), json.loads(said.out)
    chosen, arguments = data["choice"]["chosen"], build_parser().parse_args(words[1:])
    assert words[0] == "lfsr" and str(arguments.scene) == scene
    samples = samples_at(load_display("mini"), arguments.scale, arguments.rays)
    assert (arguments.scale, samples, arguments.method) == (chosen["scale"], chosen["samples"], chosen["method"])
    assert (arguments.display, arguments.frame, arguments.world_visible) == ("mini", 3, False)
    assert chosen["estimate"]["low"] >= 0.5 and data["options"]["most_seconds"] is None
    assert (tmp_path / "work" / "quick" / "frame.json").exists()


def test_plan_speaks_of_as_many_lenses_as_the_result_and_says_why_it_finds_nothing(scene, blender, capsys, monkeypatch):
    assert main(["plan", scene, "--target", "0.999", *FEW, "--blender", blender]) == 0
    out = capsys.readouterr().out
    assert "nothing reaches ssim_lens_fg 0.999" in out and "Limit: " in out and "lfsr render" not in out
    monkeypatch.setattr(common, "SECONDS_BETWEEN_LINES", 0.0)
    assert main(["plan", scene, "--target", "0.5", *FEW, "--blender", blender]) == 0
    captured = capsys.readouterr()
    assert set(re.findall(r"(\d+) lenses", captured.err)) == {re.search(r"sampled (\d+) lenses", captured.out)[1]}
    fractions = [int(percent) for percent in re.findall(r"^plan +(\d+)%", captured.err, re.MULTILINE)]
    assert fractions == sorted(fractions)


@pytest.mark.parametrize(("options", "message"), [
    (["--target", "1.5"], "target is 1.5"), (["--metric", "psnr"], "metric is 'psnr'"),
    (["--rays", "1"], "--rays and --spps were both given"), (["--methods", "bilinaer"], "did you mean 'bilinear'"),
    (["--scales", "3"], "scale is 3"), (["--budget", "0"], "budget is 0"), (["--lenses", "2"], "number of lenses is 2"),
    (["--blender", "/no/blender"], "'/no/blender' was not found")])
def test_bad_option_is_refused_before_blender_starts(scene, blender, tmp_path, capsys, options, message):
    work = tmp_path / "work"
    assert message in fails(["plan", scene, *FEW, "--blender", blender, "--work", str(work), *options], capsys)
    assert not work.exists()


def start(scene, blender, *options):
    command = [sys.executable, "-m", "lfsr_core", "plan", scene, "--target", "0.5", *FEW, "--blender", blender]
    return subprocess.Popen([*command, *options], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                            start_new_session=True)


def estimates(program):
    """What a plan measured, without what it took."""
    rows = json.loads(program.communicate()[0])["candidates"]
    return {(row["scale"], row["samples"], row["method"]): row["estimate"] for row in rows}


def test_a_killed_plan_goes_on_from_its_renders(scene, blender, cache):
    def rendered():
        return {path: path.stat().st_mtime_ns for path in cache.glob("*/*/frame.json")}
    program = start(scene, blender)
    while not rendered():
        assert program.poll() is None, program.communicate()
        time.sleep(0.001)
    program.send_signal(signal.SIGKILL)
    program.communicate()
    (folder,), before = cache.iterdir(), rendered()
    again = estimates(start(scene, blender, "--json", "--work", str(folder)))  # which stays, to be looked at
    after = rendered()
    assert before.items() <= after.items() and len(after) > len(before), "what was whole is not rendered again"
    assert again == estimates(start(scene, blender, "--json"))


def test_a_changed_scene_is_planned_anew_and_an_old_plan_forgotten(scene, cache, tmp_path):
    job, options = make_request(str(tmp_path), load_display("mini"), scene=scene), PlanOptions()

    def interrupted(job):
        with contextlib.suppress(KeyboardInterrupt), work_folder(None, job, options, warnings.append) as folder:
            existed = (folder / "quick").exists()
            (folder / "quick").mkdir(exist_ok=True)
            for name in ("frame.json", "lr_eia.exr"):
                (folder / "quick" / name).touch()
            raise KeyboardInterrupt
        return existed
    warnings = []
    assert [interrupted(job), interrupted(job)] == [False, True]
    assert [told.code for told in warnings] == ["plan-kept"] * 2
    Path(scene).write_bytes(b"changed")
    assert not interrupted(job)
    for path in cache.iterdir():
        os.utime(path, (0, 0))
    assert not interrupted(job) and len(list(cache.iterdir())) == 1
    with work_folder(None, job, options, print) as first, work_folder(None, job, options, print) as second:
        assert first != second and second.is_dir()
    assert not first.exists() and not second.exists()
