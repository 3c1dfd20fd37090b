"""Tasks of the add-on: their results and errors, how they end, and making as the panel asks for it."""

import dataclasses
import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from lfsr_core.base.messages import Notice
from lfsr_core.base.records import to_data
from lfsr_core.frames.frame import read_frame, write_frame
from lfsr_core.optics.display import load_display
from lfsr_core.process.child import EXIT_BAD_INPUT, EXIT_CANCELLED, parse_progress, told_of
from lfsr_core.tasks import runner
from lfsr_core.tasks.runner import make, reference
from tests.support.animations import film_request
from tests.support.played_blender import ROOT, played_blender
from tests.support.requests import make_request
from tests.support.synthetic import write_render


@pytest.fixture
def blender(tmp_path):
    return played_blender(tmp_path / "blender")


def task(tmp_path: Path, blender: str, name: str = "plan", **options: object) -> Path:
    """A file that asks for a plan, or for two frames of an animation."""
    (tmp_path / "scene.blend").touch()
    job = make_request(str(tmp_path / "film"), load_display("mini"), scene=str(tmp_path / "scene.blend"), scale=2)
    plan = {"target": 0.5, "scales": [2], "samples": [4], "methods": ["bilinear"], "lenses": 16} | options
    data = {"options": plan} if name == "plan" else {"frames": [1, 2], "finish": {"method": "bicubic"}}
    path = tmp_path / "task.json"
    path.write_text(json.dumps({"task": name, "request": to_data(job), "command": [blender, "--"]} | data))
    return path


def run_task(path: Path) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, "-m", runner.__name__, str(path)], cwd=ROOT, stdin=subprocess.PIPE,
                            stdout=subprocess.PIPE, text=True)


def test_task_of_the_add_on_ends_with_its_result(tmp_path, blender):
    with run_task(task(tmp_path, blender)) as process:
        # Read, not communicated with: its end of input would end it.
        lines = [json.loads(line.removeprefix("LFSR ")) for line in process.stdout]
    *told, done = lines
    progress = [record for record in told if "fraction" in record]
    assert process.returncode == 0 and done["stage"] == "done"
    chosen = done["chosen"]
    assert (chosen["scale"], chosen["samples"], chosen["method"]) == (2, 4, "bilinear")
    fractions = [record["fraction"] for record in progress]
    assert fractions == sorted(fractions) and fractions[0] == 0 < fractions[-1] <= 1


def test_a_task_that_takes_the_memory_ends_in_a_sentence(tmp_path):
    write_render(tmp_path / "frame")
    data = {"task": "finish", "folder": str(tmp_path / "frame"), "finish": {"method": "bicubic"}}
    (tmp_path / "task.json").write_text(json.dumps(data))
    code = (f"import sys\nfrom lfsr_core.base import system\nfrom {runner.__name__} import main\n"
            "system.MOST_MEMORY = 0\nsys.exit(main(sys.argv[1:]))")
    with subprocess.Popen([sys.executable, "-c", code, str(tmp_path / "task.json")], cwd=ROOT, stdin=subprocess.PIPE,
                          stdout=subprocess.PIPE, text=True) as process:
        last = [parse_progress(line) for line in process.stdout][-1]
    assert process.returncode == EXIT_BAD_INPUT and "of this computer's memory" in last["message"]
    assert not (tmp_path / "frame" / "eia.png").exists()


@pytest.mark.parametrize(("how", "name"), [("signal", "plan"), ("end of input", "plan"), ("signal", "make")])
def test_task_takes_its_render_along_when_it_ends(tmp_path, how, name):
    sleeper = tmp_path / "blender"
    sleeper.write_text(f"#!/bin/sh\necho $$ > {tmp_path}/pid\nexec cat > /dev/null\n")
    sleeper.chmod(0o755)
    with run_task(task(tmp_path, str(sleeper), name)) as process:
        while not (tmp_path / "pid").exists() or not (tmp_path / "pid").read_text().strip():
            assert process.poll() is None
        time.sleep(0.2)  # until it listens to what it started
        process.send_signal(signal.SIGTERM) if how == "signal" else process.stdin.close()
        assert process.wait(10) == EXIT_CANCELLED
    assert not Path(f"/proc/{int((tmp_path / 'pid').read_text())}").exists()
    assert not list(tmp_path.glob("film/*")) and not list(tmp_path.glob("film/.*"))


@pytest.mark.parametrize(("method", "code", "record"), [
    ("bicubic", 0, {"stage": "done", "method": "bicubic"}), ("bicubik", EXIT_BAD_INPUT, {"stage": "error"})])
def test_a_task_that_starts_nothing_runs_too(tmp_path, method, code, record):
    path = tmp_path / "task.json"
    path.write_text(json.dumps({"task": "finish", "folder": str(write_render(tmp_path / "frame")),
                                "finish": {"method": method}}))
    with run_task(path) as process:
        result = json.loads(process.stdout.read().splitlines()[-1].removeprefix("LFSR "))
    assert process.returncode == code and result.items() >= record.items()
    assert code == 0 or "did you mean 'bicubic'" in result["message"]


@pytest.fixture
def folder(tmp_path) -> Path:
    played_blender(tmp_path / "blender")
    return tmp_path


def press(folder: Path, frames: list[int] | None, blender: str | None = None, options: dict[str, Any] | None = None,
          **changes: Any) -> list[tuple[int, str]]:
    done = make(to_data(film_request(folder, **changes)), {"method": "bicubic"}, [blender or str(folder / "blender"),
                "--"], frames, **options or {})
    return [(result["frame"], result["state"]) for result in done["made"]]


def test_frames_of_other_settings_are_made_again_those_of_another_device_or_an_older_scene_kept(folder, capsys):
    assert press(folder, [1, 2]) == [(1, "made"), (2, "made")]
    assert press(folder, [1, 2, 3]) == [(1, "kept"), (2, "kept"), (3, "made")]
    assert press(folder, [1], samples=64) == [(1, "made")] and read_frame(folder / "film" / "0001").samples == 64
    assert press(folder, [2], options={"overwrite": True}) == [(2, "made")]
    press(folder, [1, 2])
    for name, changes in (("0001", {"content": "of yesterday"}), ("0002", {"device": "OPTIX"})):
        path = folder / "film" / name
        write_frame(path, dataclasses.replace(read_frame(path), **changes))
    assert press(folder, [1, 2], blender="/must/not/run", device="CPU") == [(1, "kept"), (2, "kept")]
    told = [told_of(record) for line in capsys.readouterr().out.splitlines() if (record := parse_progress(line))]
    assert [notice.values["first"] for notice in told if isinstance(notice, Notice)] == [1]


def test_an_image_is_made_anew_with_its_views(folder):
    views = folder / "views.npy"
    for _ in range(2):
        assert press(folder, None, options={"views": str(views)}) == [(None, "made")]
    assert views.is_file() and (folder / "film" / "eia.png").is_file()


def test_a_reference_of_some_lenses_is_compared(folder):
    press(folder, None)
    metrics = reference(to_data(film_request(folder)), str(folder / "reference"), 16, 64,
                        [str(folder / "blender"), "--"])["metrics"]
    assert 0.3 < metrics["ssim_lens_fg"] <= 1 and len(read_frame(folder / "reference").lens_list) == 16
