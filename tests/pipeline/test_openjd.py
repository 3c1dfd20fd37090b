"""The OpenJD template, checked and run by the tool of its standard, with a Blender that is played."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from lfsr_core.base.notices import OPENJD as OPENJD_PROGRESS
from lfsr_core.base.notices import PROGRESS_VARIABLE
from lfsr_core.cli import main
from lfsr_core.frames.finish import read_report
from lfsr_core.reconstruct.methods import DEFAULT_METHOD

OPENJD = Path(sys.executable).with_name("openjd")

pytestmark = pytest.mark.skipif(not OPENJD.exists() and not os.environ.get("CI"), reason="needs openjd-cli")


@pytest.fixture
def template(tmp_path):
    assert main(["farm", "openjd", "-o", str(tmp_path / "lfsr.yaml")]) == 0
    return tmp_path / "lfsr.yaml"


def test_the_template_is_valid(template):
    done = subprocess.run([OPENJD, "check", template], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert f"default: {DEFAULT_METHOD}\n" in template.read_text()


def messages(log: str) -> list[tuple[str, str]]:
    """Kind and text of what tasks told the tool, of each task in its order."""
    return re.findall(r"\topenjd_(\w+): (.*)", log)


def test_all_steps_run_in_their_order(template, tmp_path, lfsr):
    (tmp_path / "scene.glb").touch()
    settings = {"Scene": tmp_path / "scene.glb", "Output": tmp_path / "film", "Frames": "3-4", "Parts": 2,
                "Display": "mini", "Scale": 2, "Method": "bicubic", "TemporalAveraging": 1, "Lfsr": lfsr}
    words = [word for name, value in settings.items() for word in ("-p", f"{name}={value}")]
    done = subprocess.run([OPENJD, "run", template, *words, "--step", "Finish", "--run-dependencies"], cwd=tmp_path,
                          capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    told = messages(done.stdout)
    progress = [float(text) for kind, text in told if kind == "progress"]
    assert all(0 <= value <= 100 for value in progress) and progress.count(100) >= 4, "of each merge and finish"
    assert {"merge lr_eia.exr", "load lr_eia.exr"} <= {text for kind, text in told if kind == "status"}
    film = tmp_path / "film"
    assert sorted(path.name for path in film.iterdir()) == ["0003", "0004", "parts"]
    whole = [str(lfsr), "render", str(tmp_path / "scene.glb"), "-o", str(tmp_path / "whole"), "--frames", "3-4",
             "--display", "mini", "--scale", "2", "--method", "bicubic", "--temporal-averaging", "1"]
    subprocess.run(whole, check=True, capture_output=True)
    for name in ("0003", "0004"):
        assert read_report(film / name).neighbours, "finished when all frames were rendered"
        assert (film / name / "eia.png").read_bytes() == (tmp_path / "whole" / name / "eia.png").read_bytes()


def test_why_a_task_failed_is_told(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv(PROGRESS_VARIABLE, OPENJD_PROGRESS)
    assert main(["merge", str(tmp_path), "-o", str(tmp_path / "frame")]) == 2
    said = capsys.readouterr()
    assert said.out == f"openjd_fail: {said.err}"
