"""The command as on Windows and macOS, whose functions, locks and open files stand-ins play on Linux."""

import contextlib
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from lfsr_core.images.image_files import read_png
from tests.support.other_systems import FOLDER, SYSTEMS, names
from tests.support.played_blender import cold_blender, played_blender

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the stand-ins are of Linux")
ENDLESS = "import sys; from tests.support import noisy_renders\nif '--' in sys.argv: print('LFSR {\"stage\": " \
          "\"render\", \"fraction\": 0.1}', flush=True); sys.stdin.read()\n"
REFUSED = """
import mmap, os, sys
for name in "ab":
    with open(name, "w", encoding="utf-8") as file:
        file.write(name)
with open("b", "rb") as file:
    mapped = mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ)
print(sys.platform)
for held in (mapped, open("b", "rb")):
    try:
        os.replace("b", "c")
        os.replace("c", "b")
        print("replaced")
    except PermissionError as error:
        print("refused", error.winerror)
    mapped.close()
held.close()
os.replace("a", "b")
print(hasattr(os, "set_blocking"), hasattr(os, "killpg"))
"""


@pytest.fixture(params=SYSTEMS, ids=lambda system: system.name)
def system(request):
    return request.param


@pytest.fixture
def folder(tmp_path):
    (tmp_path / FOLDER).mkdir()
    (tmp_path / FOLDER / "scene.glb").touch()
    return tmp_path / FOLDER


def words(folder: Path, blender: str) -> list[str]:
    return ["render", str(folder / "scene.glb"), "-o", str(folder / "frame"), "--display", "mini", "--scale", "2",
            "--method", "bicubic", "--blender", blender]


def test_the_stand_in_refuses_what_the_system_does(tmp_path, system, monkeypatch):
    monkeypatch.chdir(tmp_path)
    program = system.start("-c", REFUSED)
    said, refused = program.communicate()[0].split("\n"), system.name == "win32"
    assert said[0] == system.name and program.returncode == 0, said
    assert said[1:3] == ["refused 32" if refused else "replaced"] * 2
    assert said[3] == ("False False" if refused else "True True")


@pytest.mark.parametrize("system", [SYSTEMS[0], pytest.param(SYSTEMS[1], marks=pytest.mark.long)], indirect=True,
                         ids=lambda system: system.name)
def test_render_again_upscale_view_and_frames(folder, system):
    render = words(folder, cold_blender(folder / "blender"))
    said = system.lfsr(render, render)
    assert said.count("eia.png: bicubic") == 2 and "?" in said, "a letter that the terminal lacks"
    assert names(folder) == ["blender", "frame", "scene.glb"]
    first = read_png(folder / "frame" / "eia.png")
    system.lfsr(["upscale", str(folder / "frame"), "--method", "bilinear"], ["view", str(folder / "frame")])
    assert np.any(first != read_png(folder / "frame" / "eia.png"))
    assert names(folder / "frame") == ["eia.png", "frame.json", "lr_eia.exr", "mask.png", "report.json", "view.html"]
    render[3], render[-1] = str(folder / "film"), played_blender(folder / "another")
    said = system.lfsr([*render, "--frames", "1-2"], [*render, "--frames", "1-3"])
    assert "2 frames: 2 made" in said and "3 frames: 1 made, 2 kept" in said
    assert names(folder / "film") == ["0001", "0002", "0003"]


@pytest.fixture
def rendering(folder, system):
    """A render that does not end, its folder, and its Blender's process id."""
    blender = Path(cold_blender(folder / "blender"))
    text = blender.read_text(encoding="utf-8")
    blender.write_text(text.replace("from tests", ENDLESS + "from tests", 1), encoding="utf-8")
    program = system.start("-m", "lfsr_core", *words(folder, str(blender)))
    for line in program.stdout:
        if "render" in line:
            break
    (child,) = Path(f"/proc/{program.pid}/task/{program.pid}/children").read_text(encoding="utf-8").split()
    yield program, int(child)
    program.kill()


def test_cancel_ends_blender_and_leaves_nothing(folder, rendering):
    program, child = rendering
    started = time.monotonic()
    program.send_signal(signal.SIGINT)
    said, _ = program.communicate(timeout=60)
    assert program.returncode == 130 and "Traceback" not in said and time.monotonic() - started < 30, said
    assert not os.path.exists(f"/proc/{child}") and names(folder) == ["blender", "scene.glb"]


def test_a_second_render_is_refused_and_what_a_killed_one_left_goes(folder, system, rendering):
    program, child = rendering
    again = words(folder, played_blender(folder / "another"))
    second = system.start("-m", "lfsr_core", *again)
    assert "another process is writing" in second.communicate(timeout=60)[0] and second.returncode == 2
    program.kill()
    with contextlib.suppress(ProcessLookupError):
        os.kill(child, signal.SIGKILL)  # a job object would
    program.wait()
    assert len(names(folder)) == 4
    system.lfsr(again)
    assert names(folder) == ["another", "blender", "frame", "scene.glb"]
