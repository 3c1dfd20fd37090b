"""Windows' Python and Blender under Wine, where ``scripts/windows_python.sh`` has made them.

    LFSR_WINDOWS_PYTHON=DIR python -m pytest tests/test_wine.py
"""

import os
import signal
import subprocess
from pathlib import Path

import pytest

from lfsr_core.frames.frame import read_frame
from lfsr_core.images.image_files import read_png
from tests.support.other_systems import FOLDER, ROOT, names

FOUND = os.environ.get("LFSR_WINDOWS_PYTHON", "")
pytestmark = pytest.mark.skipif(not FOUND, reason="needs LFSR_WINDOWS_PYTHON=DIR, made by scripts/windows_python.sh")
# Tests that need nothing of POSIX.
PORTABLE = ("tests/base/test_records.py", "tests/frames", "tests/pipeline/test_parts.py",
            "tests/base/test_system.py::"
            "test_a_second_render_into_the_same_folder_is_refused_and_what_a_dead_one_left_goes",
            "tests/base/test_system.py::test_a_released_folder_locks_nobody_out_and_goes_with_its_process",
            "tests/base/test_system.py::test_a_folder_goes_at_whatever_moment_its_process_was_killed",
            "tests/base/test_system.py::test_files_are_replaced_all_or_none",
            "tests/base/test_system.py::test_failure_keeps_the_old_file_and_leaves_nothing_else",
            "tests/base/test_system.py::test_what_a_killed_writer_left_goes_with_the_next_and_a_living_one_keeps_its_own")
# A child and its own child, which do not read their input; the first says who they are.
DEAF = """import subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
print('LFSR {"stage": "x", "pid": %d}' % child.pid, flush=True)
time.sleep(600)"""
STOPPED = f"""import ctypes, os, sys
from lfsr_core.process.child import Child
def lives(pid):
    handle = ctypes.windll.kernel32.OpenProcess(0x100000, False, pid)
    return bool(handle) and ctypes.windll.kernel32.WaitForSingleObject(handle, 2000) == 258
with Child([sys.executable, "-c", {DEAF!r}]) as child:
    pid = next(child.records())["pid"]
    print(lives(pid), lives(child.pid), flush=True)
    if sys.argv[1] == "stop":
        child.stop(0.2)
        print(lives(pid), lives(child.pid), flush=True)
    else:
        print(pid, child.pid, flush=True)
        os._exit(1)"""
LIVE = """import ctypes, sys
for pid in sys.argv[1:]:
    handle = ctypes.windll.kernel32.OpenProcess(0x100000, False, int(pid))
    print(bool(handle) and ctypes.windll.kernel32.WaitForSingleObject(handle, 2000) == 258)"""


def start(*words: object) -> subprocess.Popen[str]:
    """Start Windows' Python; what it prints is in a code page of Windows."""
    environment = os.environ | {"WINDOWS_PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.Popen([Path(FOUND, "python"), *map(str, words)], cwd=ROOT, env=environment, text=True,
                            encoding="cp1252", errors="replace", stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                            stderr=subprocess.STDOUT)


def run(*words: object, code: int = 0) -> str:
    program = start(*words)
    said, _ = program.communicate(timeout=500)
    assert program.returncode == code and "Traceback" not in said, said
    return said


@pytest.fixture
def folder(tmp_path):
    (tmp_path / FOLDER).mkdir()
    return tmp_path / FOLDER


@pytest.fixture
def words(folder):
    """A render of a file that Windows' Blender has saved."""
    run("-c", f"import bpy; bpy.ops.wm.save_as_mainfile(filepath={'Z:' + str(folder / 'scene.blend')!r})")
    return ["-m", "lfsr_core", "render", f"Z:{folder / 'scene.blend'}", "-o", f"Z:{folder / 'frame'}", "--display",
            "mini", "--scale", "4", "--spp", "1", "--method", "bicubic"]


def test_portable_tests_pass(tmp_path):
    # A short name, or messages cut it.
    said = run("-m", "pytest", "-q", "-p", "no:cacheprovider", "--basetemp", f"Z:{tmp_path.parent}/w", *PORTABLE)
    assert " passed" in said


def test_a_job_ends_with_its_child():
    assert run("-c", STOPPED, "stop").split() == ["True", "True", "False", "False"]
    assert not run("-c", "import lfsr_core.tasks.runner; from lfsr_core.reconstruct.methods import denoise; "
                         "print(denoise.why_missing())").strip()


def test_a_job_ends_with_the_process_that_made_it():
    *alive, pid, child = run("-c", STOPPED, "leave", code=1).split()
    assert alive == ["True", "True"] and run("-c", LIVE, pid, child).split() == ["False", "False"]


def test_renders_frames_upscale_and_view(folder, words):
    for seed in (1, 2):
        assert "eia.png: bicubic" in run(*words, "--seed", seed)
        assert read_frame(folder / "frame").seed == seed and read_png(folder / "frame" / "eia.png").any()
    run("-m", "lfsr_core", "upscale", f"Z:{folder / 'frame'}", "--method", "denoise+bilinear")
    run("-m", "lfsr_core", "view", f"Z:{folder / 'frame'}")
    assert {"eia.png", "frame.json", "lr_eia.exr", "mask.png", "report.json", "view.html"} <= {*names(folder / "frame")}
    words[words.index(f"Z:{folder / 'frame'}")] = f"Z:{folder / 'film'}"
    assert "2 frames: 2 made" in run(*words, "--frames", "1-2")
    assert names(folder) == ["film", "frame", "scene.blend"] and names(folder / "film") == ["0001", "0002"]


def test_cancel_leaves_nothing(folder, words):
    words[words.index("--spp") + 1] = "400000"
    program = start(*words)
    for line in program.stdout:
        if "Sample" in line:
            break
    program.send_signal(signal.SIGINT)
    said, _ = program.communicate(timeout=60)
    assert "interrupted" in said and "Traceback" not in said, said
    assert names(folder) == ["scene.blend"]
