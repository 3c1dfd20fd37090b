"""The Flamenco job type, compiled in Node by a stub that follows the documented interface, and its tasks run."""

import importlib.util
import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from lfsr_core.cli import main
from lfsr_core.reconstruct.averaging import near
from lfsr_core.reconstruct.methods import DEFAULT_METHOD

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


pytestmark = pytest.mark.skipif(not node() and not os.environ.get("CI"), reason="needs Node")


def compiled(folder: Path, **settings) -> dict:
    assert main(["farm", "flamenco", "-o", str(folder / "lfsr.js")]) == 0
    (folder / "settings.json").write_text(json.dumps(settings))
    done = subprocess.run([node(), STUB, folder / "lfsr.js", folder / "settings.json"], capture_output=True, text=True,
                          check=True)
    return json.loads(done.stdout)


def test_settings_are_of_kinds_that_flamenco_has(tmp_path):
    found = compiled(tmp_path, frames="1", parts=1, output="/o", blendfile="/s.blend", method="m", lfsr="lfsr",
                     display="mini", scale="4", rays=1.5, seed=0, light="auto", device="CPU", linear="--linear-exr",
                     temporalaveraging=0)["type"]
    settings = {setting["key"]: setting for setting in found["settings"]}
    assert {setting["type"] for setting in settings.values()} <= TYPES
    assert set().union(*settings.values()) <= KEYS
    assert settings["method"]["default"] == DEFAULT_METHOD and found["label"]


def test_tasks_run_in_the_order_of_their_dependencies(tmp_path, lfsr):
    (tmp_path / "scene.glb").touch()
    output = tmp_path / "film"
    tasks = compiled(tmp_path, frames="2, 7-8", parts=2, output=str(output), blendfile=str(tmp_path / "scene.glb"),
                     method="bicubic", lfsr=str(lfsr), display="mini", scale="2", rays=1, seed=0, light="city",
                     linear="--no-linear-exr", device="CPU", temporalaveraging=0)["tasks"]
    assert len(tasks) == 3 * (2 + 1 + 1)
    done: set[str] = set()
    for task in tasks:
        assert set(task["dependencies"]) <= done and task["type"] == "blender"
        command, = task["commands"]
        assert command["name"] == "exec" and all(isinstance(word, str) for word in command["parameters"]["args"])
        subprocess.run([command["parameters"]["exe"], *command["parameters"]["args"]], check=True, capture_output=True)
        done.add(task["name"])
    assert [path.parent.name for path in sorted(output.glob("*/eia.png"))] == ["0002", "0007", "0008"]


def test_a_frame_that_shares_is_finished_after_those_beside_it_are_merged(tmp_path):
    tasks = compiled(tmp_path, frames="9, 1-7", parts=1, output="/o", blendfile="/s.blend", method="m", lfsr="lfsr",
                     display="mini", scale="4", rays=1.5, seed=0, light="auto", device="CPU", linear="--linear-exr",
                     temporalaveraging=1)["tasks"]
    names, frames = [task["name"] for task in tasks], (*range(1, 8), 9)
    for task in tasks:
        assert {names.index(name) for name in task["dependencies"]} <= set(range(names.index(task["name"])))
        number = task["name"].removeprefix("finish-")
        if number != task["name"]:
            merged = {int(name.removeprefix("merge-")) for name in task["dependencies"]}
            assert merged >= {int(number), *near(int(number), frames, 1)}
            assert len(merged) <= 5, "no more wait than have to"
            assert task["commands"][0]["parameters"]["args"][-2:] == ["--temporal-averaging", "1"]
