"""`lfsr plan` from its arguments to its table, with Blender played by a script; the task of the add-on likewise."""

from __future__ import annotations

import json
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lfsr_core.cli import build_parser, main
from lfsr_core.frames.job import Job
from lfsr_core.optics.display import load_display
from lfsr_core.records import to_data
from lfsr_core.render.protocol import EXIT_BAD_INPUT, EXIT_CANCELLED
from lfsr_core.tasks import runner
from tests.support.synthetic import fails

ROOT = Path(__file__).parents[2]
FEW = ["--display", "mini", "--scales", "2", "--spps", "4", "--methods", "nearest,bilinear", "--lenses", "24",
       "--reference-spp", "256"]

BLENDER = """#!{python}
import json, sys
from pathlib import Path
sys.path[:0] = [{root!r}, {tests!r}]
if "--version" in sys.argv:
    print("Blender 5.0.1")
    sys.exit()
from tests.plan.test_planner import render
from lfsr_core.frames.job import read_job
render(read_job(sys.argv[-1]))
print('LFSR {{"stage": "done", "folder": "."}}')
"""


@pytest.fixture
def blender(tmp_path):
    path = tmp_path / "blender"
    path.write_text(BLENDER.format(python=sys.executable, root=str(ROOT), tests=str(ROOT / "tests")))
    path.chmod(0o755)
    return str(path)


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "my scene.glb"
    path.touch()
    return str(path)


def test_plan_ends_with_the_command_that_renders_the_choice(scene, blender, tmp_path, capsys):
    file = tmp_path / "plan.json"
    assert main(["plan", scene, "--target", "0.5", *FEW, "--frame", "3", "--no-world-visible", "--blender", blender,
                 "--json", str(file), "--work", str(tmp_path / "work")]) == 0
    *_, command = capsys.readouterr().out.splitlines()
    words = shlex.split(command)
    data = json.loads(file.read_text())
    chosen = data["chosen"]
    arguments = build_parser().parse_args(words[1:])
    assert words[0] == "lfsr" and str(arguments.scene) == scene
    assert (arguments.scale, arguments.spp, arguments.method) == (chosen["scale"], chosen["spp"], chosen["method"])
    assert (arguments.display, arguments.frame, arguments.world_visible) == ("mini", 3, False)
    assert chosen["estimate"]["low"] >= 0.5 and data["options"]["most_seconds"] is None
    assert (tmp_path / "work" / "quick" / "frame.json").exists()


def test_plan_that_finds_nothing_says_why_and_names_no_command(scene, blender, capsys):
    assert main(["plan", scene, "--target", "0.999", *FEW, "--blender", blender]) == 0
    out = capsys.readouterr().out
    assert "nothing reaches ssim_eia_fg 0.999" in out and "Limit: " in out and "lfsr render" not in out


@pytest.mark.parametrize(("options", "message"), [
    (["--target", "1.5"], "target is 1.5"), (["--metric", "psnr"], "metric is 'psnr'"),
    (["--methods", "bilinaer"], "did you mean 'bilinear'"), (["--scales", "3"], "scale is 3"),
    (["--budget", "0"], "budget is 0"), (["--lenses", "2"], "number of lenses is 2"),
    (["--layout", "view-by-view"], "view-by-view"), (["--blender", "/no/blender"], "'/no/blender' was not found")])
def test_bad_option_is_refused_before_blender_starts(scene, blender, tmp_path, capsys, options, message):
    work = tmp_path / "work"
    assert message in fails(["plan", scene, *FEW, "--blender", blender, "--work", str(work), *options], capsys)
    assert not work.exists()


def test_scales_that_are_no_numbers_are_refused(scene):
    with pytest.raises(SystemExit):
        main(["plan", scene, "--scales", "two"])


def task(tmp_path: Path, blender: str, **options: object) -> Path:
    job = Job(output=str(tmp_path), display=load_display("mini"), scene="scene.blend")
    options = {"target": 0.5, "scales": [2], "spps": [4], "methods": ["bilinear"], "lenses": 16} | options
    path = tmp_path / "task.json"
    path.write_text(json.dumps({"task": "plan", "job": to_data(job), "options": options, "command": [blender],
                                "work": str(tmp_path / "work")}))
    return path


def run_task(path: Path) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, "-m", runner.__name__, str(path)], cwd=ROOT, stdin=subprocess.PIPE,
                            stdout=subprocess.PIPE, text=True)


def test_task_of_the_add_on_ends_with_its_result(tmp_path, blender):
    with run_task(task(tmp_path, blender)) as process:
        # Read, not communicated with: its end of input would end it.
        lines = [json.loads(line.removeprefix("LFSR ")) for line in process.stdout]
    *progress, done = lines
    assert process.returncode == 0 and done["stage"] == "done"
    assert done["chosen"] == {"scale": 2, "spp": 4, "method": "bilinear"} and "s2-spp4 bilinear" in done["sentence"]
    fractions = [record["fraction"] for record in progress]
    assert fractions == sorted(fractions) and fractions[0] == 0 < fractions[-1] <= 1


def test_task_with_bad_options_ends_with_one_sentence(tmp_path, blender):
    with run_task(task(tmp_path, blender, target=2.0)) as process:
        record = json.loads(process.stdout.read().removeprefix("LFSR "))
    assert process.returncode == EXIT_BAD_INPUT
    assert record["stage"] == "error" and "target is 2.0" in record["message"]


@pytest.mark.parametrize("how", ["signal", "end of input"])
def test_task_takes_its_render_along_when_it_ends(tmp_path, how):
    sleeper = tmp_path / "blender"
    sleeper.write_text(f"#!/bin/sh\necho $$ > {tmp_path}/pid\nexec sleep 60\n")
    sleeper.chmod(0o755)
    with run_task(task(tmp_path, str(sleeper))) as process:
        while not (tmp_path / "pid").exists() or not (tmp_path / "pid").read_text().strip():
            assert process.poll() is None
        time.sleep(0.2)  # until it listens to what it started
        process.send_signal(signal.SIGTERM) if how == "signal" else process.stdin.close()
        assert process.wait(10) == EXIT_CANCELLED
    pid = int((tmp_path / "pid").read_text())
    assert not Path(f"/proc/{pid}").exists()
    assert not (tmp_path / "work" / "quick").exists()
