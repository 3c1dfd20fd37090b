"""Which Python runs the second stage, and what the Test button says about it."""

import subprocess
import sys
from pathlib import Path

import bpy
import pytest

import lfsr_core
from blender_addon.jobs import runtime
from blender_addon.ui import preferences
from lfsr_core import __version__
from lfsr_core.base.cores import CORES

PROBE = "lfsr_core.tasks.probe"


def test_blenders_own_python_is_isolated(addon, monkeypatch, tmp_path):
    """From the user's variables, the user's packages and the folder in which Blender was started."""
    for name in ("numpy.py", "lfsr_core.py"):
        (tmp_path / name).write_text("raise SystemExit('the wrong one')")
    user = tmp_path / "user"
    packages = subprocess.run([sys.executable, "-m", "site", "--user-site"], capture_output=True, text=True,
                              env={"PYTHONUSERBASE": str(user)}, check=False).stdout.strip()
    assert packages.startswith(str(user))
    Path(packages).mkdir(parents=True)
    (Path(packages) / "usercustomize.py").write_text("raise SystemExit('the wrong one')")
    for name, value in {"PYTHONPATH": tmp_path, "PYTHONUSERBASE": user, "PYTHONSTARTUP": tmp_path / "numpy.py",
                        "PYTHONHOME": tmp_path}.items():
        monkeypatch.setenv(name, str(value))
    monkeypatch.chdir(tmp_path)
    assert str(tmp_path) not in runtime.environment()["PYTHONPATH"]
    assert preferences.probe().startswith("Python ")


def test_preference_wins_over_the_environment(addon, monkeypatch, bare_python):
    monkeypatch.setenv(runtime.PYTHON_VARIABLE, bare_python)
    assert runtime.second_stage_command(PROBE)[0] == bare_python
    addon.python_path = sys.executable
    assert runtime.second_stage_command(PROBE)[0] == sys.executable
    assert f"LFSR {__version__}" in preferences.probe()


def test_lfsr_core_is_the_addons_own(addon, bare_python):
    """Even if the user's Python has another one."""
    [packages] = answer([bare_python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"])
    other = Path(packages, "lfsr_core", "__init__.py")
    other.parent.mkdir()
    other.touch()
    addon.python_path, ask = bare_python, [bare_python, "-P", "-c", "import lfsr_core; print(lfsr_core.__file__)"]
    assert answer(ask) == [str(other)]
    assert answer(ask, runtime.environment()) == [lfsr_core.__file__]


def test_a_python_of_the_users_brings_its_own_packages(addon, bare_python):
    """Blender's are those of Blender's Python, which may be of another version."""
    ask, blenders = [bare_python, "-c", "import sys; print(sys.path)"], bpy.utils.resource_path("LOCAL")
    assert blenders in answer(ask, runtime.environment())[0]
    addon.python_path = bare_python
    assert blenders not in answer(ask, runtime.environment())[0]


def answer(command, environment=None):
    """Lines that a Python prints, by default with nothing in its environment."""
    done = subprocess.run(command, capture_output=True, text=True, env=environment or {}, check=True)
    return done.stdout.splitlines()


def test_cores_stay_free_as_the_preference_says(addon, monkeypatch):
    monkeypatch.setattr(runtime.os, "cpu_count", lambda: 8)
    for free, used in ((1, "7"), (0, "8"), (3, "5"), (9, "1")):
        addon.free_cores = free
        assert {runtime.environment()[name] for name in (CORES, "OIDN_NUM_THREADS")} == {used}
    monkeypatch.setenv(CORES, "2")
    assert runtime.environment()[CORES] == "2", "the user's own choice"


@pytest.fixture
def auto_run():
    """The preference that lets files run their Python, off again afterwards."""
    preferences = bpy.context.preferences
    yield preferences
    preferences.filepaths.use_scripts_auto_execute = False
    for entry in list(preferences.autoexec_paths):
        preferences.autoexec_paths.remove(entry)


def test_a_background_blender_runs_no_python_that_this_session_would_not(auto_run, tmp_path):
    file = str(tmp_path / "shots" / "scene.blend")
    assert not bpy.app.autoexec_fail, "nothing was blocked yet, which is no leave"
    assert not runtime.may_run_scripts(file)
    auto_run.filepaths.use_scripts_auto_execute = True
    assert runtime.may_run_scripts(file)
    excluded = auto_run.autoexec_paths.new()
    excluded.path = str(tmp_path / "shots")
    assert not runtime.may_run_scripts(file)
    assert runtime.may_run_scripts(str(tmp_path / "own.blend"))
    excluded.path, excluded.use_glob = "*/shots/*.blend", True
    assert not runtime.may_run_scripts(file)
