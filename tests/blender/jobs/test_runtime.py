"""What runs the second stage and renders in the background, and what lacks without Open Image Denoise."""

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import bpy
import pytest

from blender_addon.check import last
from blender_addon.check.last import check_scene
from blender_addon.jobs import folders, runtime
from blender_addon.jobs.session import Task
from blender_addon.scene import settings as scene_settings
from blender_addon.ui.operators import render
from lfsr_core import __version__
from lfsr_core.base.system import CORES
from lfsr_core.frames.frame import read_report
from lfsr_core.reconstruct.methods import DEFAULT_METHOD
from lfsr_core.reconstruct.methods.denoise import LIBRARY_VARIABLE
from tests.support import panel
from tests.support.told import refuses


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
    program = "import lfsr_core.tasks.runner; print(lfsr_core.__version__)"
    done = subprocess.run(runtime.second_stage_command("-c", program), env=runtime.environment(),
                          capture_output=True, text=True, check=False)
    assert done.stdout == f"{__version__}\n"


def test_cores_stay_free_and_the_library_is_named_as_the_preferences_say(addon, monkeypatch, tmp_path):
    monkeypatch.setattr(runtime.os, "cpu_count", lambda: 8)
    for free, used in ((1, "7"), (0, "8"), (3, "5"), (9, "1")):
        addon.free_cores = free
        assert {runtime.environment()[name] for name in (CORES, "OIDN_NUM_THREADS")} == {used}
    monkeypatch.setenv(CORES, "2")
    assert runtime.environment()[CORES] == "2", "the user's own choice"
    addon.oidn_path = str(tmp_path / "gone.so")
    refuses(r"the library .*gone.so' of Open Image Denoise does not exist: choose another", runtime.environment)
    (tmp_path / "gone.so").write_bytes(b"")
    assert runtime.environment()[LIBRARY_VARIABLE] == str(tmp_path / "gone.so") and runtime.why_missing()
    addon.oidn_path = ""
    assert LIBRARY_VARIABLE not in runtime.environment() and not runtime.why_missing()


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
    assert not runtime.may_run_scripts(file) and runtime.may_run_scripts(str(tmp_path / "own.blend"))
    excluded.path, excluded.use_glob = "*/shots/*.blend", True
    assert not runtime.may_run_scripts(file)


@pytest.fixture
def scene(scene):
    scene.lfsr.method = DEFAULT_METHOD
    return scene


@pytest.fixture
def without_library(tmp_path, monkeypatch) -> Path:
    """The only library is no library."""
    broken = tmp_path / "libOpenImageDenoise.so.2"
    broken.write_bytes(b"no library")
    monkeypatch.setenv(LIBRARY_VARIABLE, str(broken))
    return broken


def codes(scene: bpy.types.Scene) -> list[str]:
    return [problem.code for problem in check_scene(scene)]


def test_with_the_library_nothing_is_asked_and_every_method_finishes(scene):
    assert not runtime.why_missing() and "denoise" not in codes(scene)
    assert bpy.ops.lfsr.render_eia() == {"FINISHED"}
    assert render.methods(scene)[0] == DEFAULT_METHOD and "none" not in render.methods(scene)


def test_without_the_library_a_render_is_refused_and_the_check_offers_what_there_is(scene, without_library):
    said = f"The method Default needs Open Image Denoise, but {without_library.name} cannot be loaded: "
    for operator in (bpy.ops.lfsr.render_eia, bpy.ops.lfsr.render_animation):
        panel.refused(f"{said}.*blender.org.*preferences", operator)
    assert not folders.scene_folder(scene).exists()
    last.check(scene)
    assert codes(scene)[0] == "denoise"
    assert bpy.ops.lfsr.check_fix(code="denoise", target="Open Image Denoise") == {"FINISHED"}
    assert scene.lfsr.method == "pool" and "denoise" not in codes(scene)


def test_the_answer_is_remembered_for_scenes_without_a_chosen_method(scene, without_library, monkeypatch):
    addon = SimpleNamespace(without_denoiser=False)
    monkeypatch.setattr(runtime, "preferences_of_addon", lambda: addon)
    scene.lfsr.property_unset("method")
    (question,) = render._denoising(scene)
    question.accept()
    assert addon.without_denoiser and scene.lfsr.method == "pool"
    scene.lfsr.property_unset("method")
    assert render._denoising(scene) == [] and scene.lfsr.method == "pool"
    scene.lfsr.method = DEFAULT_METHOD
    assert len(render._denoising(scene)) == 1, "a method that was chosen is asked about"


def test_direct_rendering_can_leave_the_noise_and_a_blender_without_the_library_is_named(scene, monkeypatch):
    monkeypatch.setattr(runtime, "why_missing", lambda: "none was found")
    said = runtime.lacking(scene_settings.resolve(scene))
    assert said == "The method Default needs Open Image Denoise, which this Blender does not have"
    scene.lfsr.display, scene.lfsr.subpixels = "looking-glass-go", True
    settings = scene_settings.resolve(scene)
    assert settings.method.text == "oidn"
    scene.lfsr.samples, before = 0, scene.lfsr.rays
    runtime.use_replacement(scene, settings)
    assert scene_settings.resolve(scene).method.text == "none" and scene.lfsr.rays == 2 * before


def test_a_missing_library_is_told_before_the_render_and_an_unfinished_one_finished_by_another_method(
        scene, without_library):
    scene.lfsr.method, folder = "pool", folders.frame_folder(scene)
    assert bpy.ops.lfsr.render_eia() == {"FINISHED"}
    scene.lfsr.method = DEFAULT_METHOD
    refuses("not available", Task("Render EIA", render.image_job(scene)).run)
    for name in ("eia.png", "mask.png", "report.json"):
        (folder / name).unlink()  # as where the second stage failed
    assert [path.name for path in folder.parent.iterdir()] == ["0001"]
    assert folders.is_unfinished(folder) and "The render is kept" in folders.kept(folder)
    assert render.methods(scene) == ["pool", "bilinear", "bicubic", "nearest"]
    rendered = (folder / "lr_eia.exr").stat().st_mtime_ns
    assert bpy.ops.lfsr.finish_frame(method="pool") == {"FINISHED"}
    assert (folder / "lr_eia.exr").stat().st_mtime_ns == rendered
    assert read_report(folder).method == "pool" and folders.is_decoded(folder)
    assert folders.is_made(*folders.requested(scene)) and not folders.is_unfinished(folder)
    panel.refused("There is no unfinished render in .*: render the EIA", bpy.ops.lfsr.finish_frame, method="pool")


@pytest.mark.skipif(sys.platform != "linux", reason="distributions are those of Linux")
@pytest.mark.parametrize(("names", "start"), [
    ({"ID": "debian"}, "Debian has no package of it: use the Blender of blender.org, which has it, or choose lib"),
    ({"ID": "linuxmint", "ID_LIKE": "ubuntu debian"}, "Linuxmint has no package of it: use"),
    ({"ID": "fedora"}, "Install the package oidn-libs, or use the Blender of blender.org"),
    ({"ID": "manjaro", "ID_LIKE": "arch"}, "Install the package openimagedenoise, or use"),
    ({"ID": "own"}, "Use the Blender of blender.org")])
def test_the_sentence_is_that_of_the_system(monkeypatch, names, start):
    monkeypatch.setattr("platform.freedesktop_os_release", lambda: names)
    assert runtime.where_to_get().startswith(start)
