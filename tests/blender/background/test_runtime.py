"""Which Python runs the second stage, and what the Test button says about it."""

from __future__ import annotations

import subprocess
import sys

import bpy
import pytest

from blender_addon.background import runtime
from blender_addon.ui import preferences
from lfsr_core import __version__
from lfsr_core.cores import CORES
from lfsr_core.errors import LfsrError


def test_blenders_own_python_is_isolated(addon, monkeypatch, tmp_path):
    (tmp_path / "numpy.py").write_text("raise SystemExit('the wrong numpy')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    assert runtime.second_stage_command()[:2] == [sys.executable, "-I"]
    assert "PYTHONPATH" not in runtime.environment()
    assert preferences.probe().startswith("Python ")


def test_preference_wins_over_the_environment(addon, monkeypatch, bare_python):
    monkeypatch.setenv(runtime.PYTHON_VARIABLE, bare_python)
    assert runtime.second_stage_command()[0] == bare_python
    addon.python_path = sys.executable
    assert runtime.second_stage_command()[0] == sys.executable
    assert f"LFSR {__version__}" in preferences.probe()


def test_lfsr_core_is_the_addons_own(addon, tmp_path):
    """Even if the user's Python has another one."""
    other = tmp_path / "lfsr_core"
    other.mkdir()
    (other / "__init__.py").write_text("raise SystemExit('the wrong lfsr_core')")
    addon.python_path = sys.executable
    done = subprocess.run([*runtime.second_stage_command(), "--version"], cwd=tmp_path, capture_output=True, text=True,
                          env=runtime.environment() | {"PYTHONPATH": str(tmp_path)}, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, f"lfsr {__version__}"), done.stderr


def test_library_that_is_not_installed_is_reported(addon, monkeypatch):
    monkeypatch.setattr(runtime.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(LfsrError, match="install the add-on from its zip again"):
        runtime.second_stage_command()


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
