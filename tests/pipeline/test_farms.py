"""Templates for farms: checked by a stub and the standard's tool, and run with a played Blender."""

import contextlib
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lfsr_core.cli import main
from lfsr_core.commands.common import OPENJD as OPENJD_PROGRESS
from lfsr_core.commands.common import PROGRESS_VARIABLE
from lfsr_core.frames.frame import read_report
from lfsr_core.reconstruct.averaging import near
from lfsr_core.reconstruct.methods import DEFAULT_METHOD
from tests.support.played_blender import warm_lfsr

STUB = Path(__file__).with_name("flamenco_stub.js")
# As Flamenco's documentation lists them.
TYPES = {"string", "int32", "float", "bool"}
KEYS = {"key", "type", "subtype", "choices", "propargs", "description", "default", "eval", "evalInfo", "visible",
        "required", "editable", "label"}

def node() -> str | None:
    """Node on the path, or the one that comes with Playwright."""
    spec = importlib.util.find_spec("playwright")
    own = Path(spec.origin).parent / "driver" / "node" if spec else None
    return shutil.which("node") or (str(own) if own and own.exists() else None)


needs_node = pytest.mark.skipif(not node() and not os.environ.get("CI"), reason="needs Node")


SETTINGS = {"frames": "1", "parts": 1, "output": "/o", "blendfile": "/s.blend", "method": "m", "lfsr": "lfsr",
            "display": "mini", "scale": "4", "rays": 1.5, "seed": 0, "light": "auto", "device": "CPU",
            "linear": "--linear-exr", "temporalaveraging": 0}


def compiled(folder: Path, **settings) -> dict:
    with contextlib.chdir(folder):
        assert main(["farm", "flamenco"]) == 0
    (folder / "settings.json").write_text(json.dumps(SETTINGS | settings))
    done = subprocess.run([node(), STUB, folder / "lfsr-light-field.js", folder / "settings.json"], capture_output=True,
                          text=True, check=True)
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def lfsr(tmp_path_factory):
    """The file of the command, with a played Blender in place of the bpy wheel."""
    return warm_lfsr(tmp_path_factory.mktemp("lfsr"))


@needs_node
def test_settings_are_of_kinds_that_flamenco_has_and_a_frame_that_shares_waits_for_those_beside_it(tmp_path):
    compilation = compiled(tmp_path, frames="9, 1-7", temporalaveraging=1)
    kind, tasks = compilation["type"], compilation["tasks"]
    settings = {setting["key"]: setting for setting in kind["settings"]}
    assert {setting["type"] for setting in settings.values()} <= TYPES and set().union(*settings.values()) <= KEYS
    assert settings["method"]["default"] == DEFAULT_METHOD and kind["label"]
    names, frames = [task["name"] for task in tasks], (*range(1, 8), 9)
    for task in tasks:
        assert {names.index(name) for name in task["dependencies"]} <= set(range(names.index(task["name"])))
        if (number := task["name"].removeprefix("finish-")) != task["name"]:
            merged = {int(name.removeprefix("merge-")) for name in task["dependencies"]}
            assert merged >= {int(number), *near(int(number), frames, 1)}
            assert len(merged) <= 5, "no more wait than have to"
            assert task["commands"][0]["parameters"]["args"][-2:] == ["--temporal-averaging", "1"]
    few, more = ({word for task in compiled(tmp_path, parts=parts)["tasks"] if task["name"].startswith("merge")
                  for word in task["commands"][0]["parameters"]["args"]} for parts in (2, 3))
    assert len(few - more) == 1, "parts of a job with fewer are in another folder"


@needs_node
def test_tasks_run_in_the_order_of_their_dependencies(tmp_path, lfsr):
    (tmp_path / "scene.glb").touch()
    output = tmp_path / "film"
    tasks = compiled(tmp_path, frames="2, 7-8", parts=2, output=str(output), blendfile=str(tmp_path / "scene.glb"),
                     method="bicubic", lfsr=str(lfsr), scale="2", rays=1, light="city",
                     linear="--no-linear-exr")["tasks"]
    assert len(tasks) == 3 * (2 + 1 + 1)
    done: set[str] = set()
    for task in tasks:
        assert set(task["dependencies"]) <= done and task["type"] == "blender"
        command, = task["commands"]
        assert command["name"] == "exec" and all(isinstance(word, str) for word in command["parameters"]["args"])
        subprocess.run([command["parameters"]["exe"], *command["parameters"]["args"]], check=True, capture_output=True)
        done.add(task["name"])
    assert [path.parent.name for path in sorted(output.glob("*/eia.png"))] == ["0002", "0007", "0008"]


OPENJD = Path(sys.executable).with_name("openjd")

needs_openjd = pytest.mark.skipif(not OPENJD.exists() and not os.environ.get("CI"), reason="needs openjd-cli")


@pytest.fixture
def template(tmp_path):
    assert main(["farm", "openjd", "-o", str(tmp_path / "lfsr.yaml")]) == 0
    return tmp_path / "lfsr.yaml"


@needs_openjd
def test_the_template_is_valid(template):
    done = subprocess.run([OPENJD, "check", template], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert f"default: {DEFAULT_METHOD}\n" in template.read_text()


@needs_openjd
def test_all_steps_run_in_their_order(template, tmp_path, lfsr):
    (tmp_path / "scene.glb").touch()
    settings = {"Scene": tmp_path / "scene.glb", "Output": tmp_path / "film", "Frames": "3-6:3",
                "Display": "mini", "Scale": 2, "Method": "bicubic", "TemporalAveraging": 1, "Lfsr": lfsr}
    words = [word for name, value in settings.items() for word in ("-p", f"{name}={value}")]
    for parts, step in ((3, "Render"), (2, "Finish")):  # the job again, with fewer parts
        done = subprocess.run([OPENJD, "run", template, *words, "-p", f"Parts={parts}", "--step", step,
                               "--run-dependencies"], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    told = re.findall(r"\topenjd_(\w+): (.*)", done.stdout)  # kind and text, of each task in its order
    progress = [float(text) for kind, text in told if kind == "progress"]
    assert all(0 <= value <= 100 for value in progress) and progress.count(100) >= 4, "of each merge and finish"
    assert {"merge lr_eia.exr", "load lr_eia.exr"} <= {text for kind, text in told if kind == "status"}
    film = tmp_path / "film"
    assert sorted(path.name for path in film.iterdir()) == ["0003", "0006", "parts"]
    whole = [str(lfsr), "render", str(tmp_path / "scene.glb"), "-o", str(tmp_path / "whole"), "--frames", "3-6x3",
             "--display", "mini", "--scale", "2", "--method", "bicubic", "--temporal-averaging", "1"]
    subprocess.run(whole, check=True, capture_output=True)
    for name in ("0003", "0006"):
        assert read_report(film / name).averaged, "finished when all frames were rendered, each with noise of its own"
        assert (film / name / "eia.png").read_bytes() == (tmp_path / "whole" / name / "eia.png").read_bytes()


def test_why_a_task_failed_is_told(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv(PROGRESS_VARIABLE, OPENJD_PROGRESS)
    assert main(["merge", str(tmp_path), "-o", str(tmp_path / "frame")]) == 2
    said = capsys.readouterr()
    assert said.out == f"openjd_fail: {said.err}"
