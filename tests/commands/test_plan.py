"""`lfsr plan` from its arguments to its table, with Blender played by a script."""

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
from lfsr_core.frames.request import samples_at
from lfsr_core.optics.display import load_display
from lfsr_core.plan.options import PlanOptions
from lfsr_core.plan.planner import work_folder
from tests.support.played_blender import played_blender
from tests.support.requests import make_request
from tests.support.synthetic import fails

ROOT = Path(__file__).parents[2]
FEW = ["--display", "mini", "--scales", "2", "--spps", "4", "--methods", "nearest,bilinear", "--lenses", "24",
       "--reference-spp", "256"]

@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "lfsr" / "plans"


@pytest.fixture
def blender(tmp_path):
    return played_blender(tmp_path / "blender")


@pytest.fixture
def logged(blender, tmp_path):
    """That Blender, and a file with a line for every render it has begun."""
    path, log = tmp_path / "logged", tmp_path / "log"
    log.touch()
    path.write_text(f"""#!/bin/sh
case "$*" in *--version*) exec {blender} "$@";; esac
echo render >> {log}
exec {blender} "$@"
""")
    path.chmod(0o755)
    return str(path), log


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "my scene.glb"
    path.touch()
    return str(path)


def test_plan_ends_with_the_command_that_renders_the_choice(scene, blender, tmp_path, capsys):
    assert main(["plan", scene, "--target", "0.5", *FEW, "--frame", "3", "--no-world-visible", "--blender", blender,
                 "--json", "--work", str(tmp_path / "work")]) == 0
    said = capsys.readouterr()
    words, data = shlex.split(said.err.splitlines()[-1]), json.loads(said.out)
    chosen = data["choice"]["chosen"]
    arguments = build_parser().parse_args(words[1:])
    assert words[0] == "lfsr" and str(arguments.scene) == scene
    samples = samples_at(load_display("mini"), arguments.scale, arguments.rays)
    assert (arguments.scale, samples, arguments.method) == (chosen["scale"], chosen["samples"], chosen["method"])
    assert (arguments.display, arguments.frame, arguments.world_visible) == ("mini", 3, False)
    assert chosen["estimate"]["low"] >= 0.5 and data["options"]["most_seconds"] is None
    assert (tmp_path / "work" / "quick" / "frame.json").exists()


def test_progress_moves_and_speaks_of_as_many_lenses_as_the_result(scene, blender, capsys, monkeypatch):
    monkeypatch.setattr(common, "SECONDS_BETWEEN_LINES", 0.0)
    assert main(["plan", scene, "--target", "0.5", *FEW, "--blender", blender]) == 0
    captured = capsys.readouterr()
    lenses = re.search(r"sampled (\d+) lenses", captured.out)[1]
    assert set(re.findall(r"(\d+) lenses", captured.err)) == {lenses}
    fractions = [int(found) for found in re.findall(r"^plan +(\d+)%", captured.err, re.MULTILINE)]
    assert fractions == sorted(fractions)


def test_plan_that_finds_nothing_says_why_and_names_no_command(scene, blender, capsys):
    assert main(["plan", scene, "--target", "0.999", *FEW, "--blender", blender]) == 0
    out = capsys.readouterr().out
    assert "nothing reaches ssim_lens_fg 0.999" in out and "Limit: " in out and "lfsr render" not in out


@pytest.mark.parametrize(("options", "message"), [
    (["--target", "1.5"], "target is 1.5"), (["--metric", "psnr"], "metric is 'psnr'"),
    (["--rays", "1"], "--rays and --spps were both given"), (["--methods", "bilinaer"], "did you mean 'bilinear'"),
    (["--scales", "3"], "scale is 3"), (["--budget", "0"], "budget is 0"), (["--lenses", "2"], "number of lenses is 2"),
    (["--blender", "/no/blender"], "'/no/blender' was not found")])
def test_bad_option_is_refused_before_blender_starts(scene, blender, tmp_path, capsys, options, message):
    work = tmp_path / "work"
    assert message in fails(["plan", scene, *FEW, "--blender", blender, "--work", str(work), *options], capsys)
    assert not work.exists()


def test_scales_that_are_no_numbers_are_refused(scene):
    with pytest.raises(SystemExit):
        main(["plan", scene, "--scales", "two"])


def start(scene, blender, *options):
    command = [sys.executable, "-m", "lfsr_core.cli", "plan", scene, "--target", "0.5", *FEW, "--blender", blender]
    return subprocess.Popen([*command, *options], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                            start_new_session=True)


def estimates(program):
    """What a plan measured, without what it took."""
    rows = json.loads(program.communicate()[0])["candidates"]
    return {(row["scale"], row["samples"], row["method"]): row["estimate"] for row in rows}


@pytest.mark.skipif(sys.platform == "win32", reason="its Blender is a shell script")
def test_a_killed_plan_goes_on_from_its_renders(scene, logged, cache, tmp_path):
    blender, log = logged
    program = start(scene, blender)
    while len(log.read_text().split()) < 4:
        assert program.poll() is None, program.communicate()
        time.sleep(0.01)
    program.send_signal(signal.SIGKILL)
    program.communicate()
    (folder,) = cache.iterdir()
    whole = sum((path / "frame.json").exists() for path in folder.iterdir())
    before = len(log.read_text().split())
    program = start(scene, blender, "--json")
    again = estimates(program)
    assert program.returncode == 0 and list(cache.iterdir()) == []
    renders = len(log.read_text().split()) - before
    whole_plan = estimates(start(scene, blender, "--json"))
    assert len(log.read_text().split()) - before - renders == renders + whole
    assert again == whole_plan


def test_a_changed_scene_is_planned_anew_and_an_old_plan_forgotten(scene, blender, cache, tmp_path):
    job, options = make_request(str(tmp_path), load_display("mini"), scene=scene), PlanOptions()

    def interrupted(job):
        with contextlib.suppress(KeyboardInterrupt), work_folder(None, job, options, warnings.append) as folder:
            found = (folder / "quick").exists()
            (folder / "quick").mkdir(exist_ok=True)
            for name in ("frame.json", "lr_eia.exr"):
                (folder / "quick" / name).touch()
            raise KeyboardInterrupt
        return found
    warnings = []
    assert [interrupted(job), interrupted(job)] == [False, True]
    assert [told.code for told in warnings] == ["plan-kept"] * 2
    Path(scene).write_bytes(b"changed")
    assert not interrupted(job)
    for path in cache.iterdir():
        os.utime(path, (0, 0))
    assert not interrupted(job)
    assert len(list(cache.iterdir())) == 1
    with work_folder(None, job, options, print) as first, work_folder(None, job, options, print) as second:
        assert first != second and second.is_dir()
    assert not first.exists() and not second.exists()
