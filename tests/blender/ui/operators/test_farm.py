"""Submit: a job for a farm that renders what the panel's button would."""

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import bpy
import pytest

from blender_addon.ui.operators import farm as buttons
from lfsr_core.base.files import read_json
from lfsr_core.pipeline.farms import TEMPLATES
from tests.pipeline.test_farms import STUB, node
from tests.support import panel

OPENJD = Path(sys.executable).with_name("openjd")


@pytest.fixture(scope="module")
def add_on():
    with panel.registered():
        yield


@pytest.fixture
def scene(add_on, tmp_path):
    scene = panel.artist_scene(tmp_path)
    scene.frame_start, scene.frame_end, scene.frame_step = 2, 6, 2
    scene.lfsr.seed, scene.lfsr.linear_exr, scene.lfsr.temporal_averaging, scene.lfsr.light = 7, True, 2, "SUNSET"
    return scene


def test_the_openjd_job_is_valid_and_says_what_the_panel_says(scene, tmp_path, capsys):
    before = panel.snapshot(scene)
    assert bpy.ops.lfsr.submit(farm="openjd", directory=str(tmp_path / "job"), parts=3) == {"FINISHED"}
    assert panel.snapshot(scene) == before
    job = tmp_path / "job"
    assert sorted(path.name for path in job.iterdir()) == ["parameter_values.json", "parameters.json",
                                                           "scene.farm.blend", "template.yaml"]
    values = read_json(job / "parameters.json", "parameters")
    assert values == {
        "Scene": str(job / "scene.farm.blend"), "Output": str(tmp_path / "lightfield" / "scene" / "Scene"),
        "Frames": "2-6:2", "Parts": 3,
        "Display": "mini", "Scale": "2", "Rays": 0.25, "Seed": 7, "Light": "sunset", "Device": "CPU",
        "Method": "bicubic", "Linear": "--linear-exr", "TemporalAveraging": 2}
    bundle = read_json(job / "parameter_values.json", "parameters")["parameterValues"]
    assert {entry["name"]: entry["value"] for entry in bundle} == values
    said = capsys.readouterr().out
    assert f"the job is in {job}" in said and "deadline bundle gui-submit" in said


@pytest.mark.skipif(not OPENJD.exists() and not os.environ.get("CI"), reason="needs openjd-cli")
def test_openjd_takes_the_job(scene, tmp_path):
    bpy.ops.lfsr.submit(farm="openjd", directory=str(tmp_path / "job"), parts=2)
    template, values = (tmp_path / "job" / name for name in ("template.yaml", "parameters.json"))
    done = subprocess.run([OPENJD, "summary", template, "-p", f"file://{values}"], capture_output=True, text=True,
                          check=False)
    assert done.returncode == 0 and "Render" in done.stdout and "6 total Tasks" in done.stdout, done.stdout


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


def test_every_farm_is_in_the_menu():
    assert {name for name, _, _ in buttons.FARM_ITEMS} == set(TEMPLATES)
