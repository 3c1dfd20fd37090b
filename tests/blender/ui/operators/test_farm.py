"""Submit: a job for a farm that renders what the panel's button would."""

import functools
import json
import os
import shlex
import subprocess
import time
from pathlib import Path

import bpy
import pytest

from blender_addon.jobs import session
from blender_addon.scene import settings as scene_settings
from blender_addon.ui import panels
from blender_addon.ui.operators import plan
from blender_addon.ui.operators import render as buttons
from lfsr_core.base.messages import Notice
from lfsr_core.base.system import read_json
from lfsr_core.pipeline.farms import TEMPLATES
from lfsr_core.plan import options
from lfsr_core.plan.options import Choice, Estimate, Rated
from lfsr_core.reconstruct.methods import DEFAULT_METHOD
from tests.blender.ui.test_panels import draw, labels, operators, properties
from tests.pipeline.test_farms import STUB, node
from tests.support import panel
from tests.support.processes import children, lives, wait_for
from tests.support.scenes import snapshot


@pytest.fixture
def scene(add_on, tmp_path):
    scene = panel.artist_scene(tmp_path)
    scene.frame_start, scene.frame_end, scene.frame_step = 2, 6, 2
    scene.lfsr.seed, scene.lfsr.linear_exr, scene.lfsr.temporal_averaging, scene.lfsr.light = 7, True, 2, "SUNSET"
    return scene


def test_the_openjd_job_is_valid_and_says_what_the_panel_says(scene, tmp_path, capsys):
    before = snapshot()
    assert bpy.ops.lfsr.submit(farm="openjd", directory=str(tmp_path / "job"), parts=3) == {"FINISHED"}
    assert snapshot() == before
    job = tmp_path / "job"
    assert sorted(path.name for path in job.iterdir()) == ["parameter_values.json", "parameters.json",
                                                           "scene.farm.blend", "template.yaml"]
    values = read_json(job / "parameters.json", "parameters")
    assert values == {
        "Scene": str(job / "scene.farm.blend"), "Output": str(tmp_path / "lightfield" / "scene" / "Scene"),
        "Frames": "2-6:2", "Parts": 3, "Display": "mini", "Scale": "2", "Rays": 0.25, "Seed": 7, "Light": "sunset",
        "Device": "CPU", "Method": "bicubic", "Linear": "--linear-exr", "TemporalAveraging": 2}
    bundle = read_json(job / "parameter_values.json", "parameters")["parameterValues"]
    assert {entry["name"]: entry["value"] for entry in bundle} == values
    said = capsys.readouterr().out
    assert f"the job is in {job}" in said and "deadline bundle gui-submit" in said
    assert {name for name, _, _ in buttons.FARM_ITEMS} == set(TEMPLATES), "every farm is in the menu"


@pytest.mark.skipif(not node() and not os.environ.get("CI"), reason="needs Node")
def test_flamencos_job_compiles_to_its_tasks(scene, tmp_path, capsys):
    assert bpy.ops.lfsr.submit(farm="flamenco", directory=str(tmp_path / "job"), parts=2) == {"FINISHED"}
    job = read_json(tmp_path / "job" / "flamenco-job.json", "a job")
    assert {"name", "type", "priority", "submitter_platform", "settings"} == set(job)
    assert (tmp_path / "job" / f"{job['type']}.js").is_file() and job["settings"]["frames"] == "2,4,6"
    (tmp_path / "settings.json").write_text(json.dumps(job["settings"]))
    compiled = json.loads(subprocess.run([node(), STUB, tmp_path / "job" / f"{job['type']}.js",
                                          tmp_path / "settings.json"], capture_output=True, text=True,
                                         check=True).stdout)
    assert set(job["settings"]) == {setting["key"] for setting in compiled["type"]["settings"]}
    words = [word for task in compiled["tasks"] for word in task["commands"][0]["parameters"]["args"]]
    assert len(compiled["tasks"]) == 3 * 4 and "undefined" not in words and "--linear-exr" in words
    command = shlex.split(capsys.readouterr().out.split("clipboard): ")[1].split("\n")[0])
    assert command[-2] == f"@{tmp_path / 'job' / 'flamenco-job.json'}"


def test_a_profile_of_ones_own_goes_along(scene, tmp_path):
    from lfsr_core.optics import display

    (tmp_path / "own.toml").write_text((display.PROFILE_FOLDER / "mini.toml").read_text())
    scene.lfsr.display, scene.lfsr.profile_file = "FILE", "//own.toml"
    bpy.ops.lfsr.submit(farm="openjd", directory="//job")
    assert read_json(tmp_path / "job" / "parameters.json", "x")["Display"] == str(tmp_path / "job" / "own.toml")
    assert (tmp_path / "job" / "own.toml").read_bytes() == (tmp_path / "own.toml").read_bytes()


@pytest.mark.parametrize(("options", "sentence"), [
    ({"directory": ""}, "No folder is chosen"), ({"parts": 13}, "Parts are 13, but they must be 1 to 12"),
    ({"directory": "//scene.blend/job"}, "scene.blend")])
def test_what_cannot_be_is_said(scene, tmp_path, options, sentence):
    panel.refused(sentence, bpy.ops.lfsr.submit, **{"farm": "openjd", "directory": str(tmp_path / "job")} | options)
    assert not list(tmp_path.glob("job/*.json"))


@pytest.fixture
def few(add_on, tmp_path, monkeypatch):
    """A small scene and a plan of few renders."""
    monkeypatch.setattr(plan, "PlanOptions", functools.partial(options.PlanOptions, scales=(2,), samples=(1,),
                                                               reference_samples=4, lenses=8))
    return panel.artist_scene(tmp_path)


def test_plan_is_found_shown_and_used(few):
    few.lfsr.plan_target, few.lfsr.scale, few.lfsr.samples = 0.5, "4", 99
    before, there = snapshot(), {*Path(bpy.app.tempdir).glob("lfsr-*")}
    assert bpy.ops.lfsr.plan() == {"FINISHED"} and snapshot() == before
    state = bpy.context.window_manager.lfsr
    assert state.plan_scene == few.name and "SSIM 0.5" in state.plan_text
    drawn = draw(panels.LFSR_PT_plan)
    assert "cale 2×, 1 sample, " in labels(drawn) and operators(drawn) == {"lfsr.plan", "lfsr.plan_use"}
    assert bpy.ops.lfsr.plan_use() == {"FINISHED"}
    assert (few.lfsr.scale, few.lfsr.samples, few.lfsr.method) == ("2", 0, state.plan_method)
    assert (few.lfsr.rays, scene_settings.resolve(few).sampling.samples) == (0.25, 1)
    assert {*Path(bpy.app.tempdir).glob("lfsr-*")} == there, "what was rendered is gone"


def test_cancel_ends_the_render_it_started(few):
    context = bpy.context
    few.lfsr.display = "bupt-32in-8k"  # its quick render alone would go on for many seconds
    task = session.start("Plan", plan.LFSR_OT_plan.prepare(None, context))
    panel.wait_for(lambda: task.child and children(task.child.pid))
    (render,) = children(task.child.pid)
    started = time.perf_counter()
    assert bpy.ops.lfsr.cancel() == {"FINISHED"}
    assert time.perf_counter() - started < 5 and session.current() is None
    wait_for(lambda: not lives(render), seconds=3)
    assert not list(Path(bpy.app.tempdir).glob("lfsr-*/*")) and task.ended
    assert not context.window_manager.lfsr.plan_text, "nothing is said that was not measured"


def test_what_a_plan_costs_is_said_before_and_one_that_finds_nothing_or_of_another_scene_is_not_used(few):
    assert "as long as" in labels(draw(panels.LFSR_PT_plan)) and "images at most" in labels(draw(panels.LFSR_PT_plan))
    state = bpy.context.window_manager.lfsr
    state.probe_scene, state.probe_per_path = few.name_full, 1e-6
    assert "Takes 10 s at most" in labels(draw(panels.LFSR_PT_plan))
    plan.show(0.95, few.name, Choice(None, None, Notice("plan-limit-unmeasured")))
    drawn = draw(panels.LFSR_PT_plan)
    assert "Nothing reaches" in labels(drawn) and operators(drawn) == {"lfsr.plan"}
    panel.refused("No settings were found", bpy.ops.lfsr.plan_use)
    plan.show(0.9, "Other", Choice(Rated(2, 4, DEFAULT_METHOD, 3.0, Estimate(0.95, 0.91, 48)), None))
    drawn = draw(panels.LFSR_PT_plan)
    assert properties(drawn) == {"plan_target"} and "0.91" not in labels(drawn)
    panel.refused("No settings were found for scene 'Scene'", bpy.ops.lfsr.plan_use)
