"""The package as ``pip install .`` leaves it: every file is there, and the command works far from the clone."""

import os
import shutil
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path, PurePosixPath

import pytest

from lfsr_core.images.image_files import read_png
from lfsr_core.optics.display import load_display
from tests.support.prerequisites import needs_bpy
from tests.support.project_files import ROOT, project_files

PACKAGES = {"lfsr_core": "lfsr_core", "blender_addon": "blender_addon", "scripts/lab/lfsr_lab": "lfsr_lab"}


def installed_paths() -> dict[str, str]:
    """Place among the installed packages of every file of theirs, and its place in the repository."""
    return {path.replace(folder, package, 1): path for path in project_files() for folder, package in PACKAGES.items()
            if path.startswith(folder + "/")}


def test_the_top_level_holds_what_was_agreed():
    assert {PurePosixPath(path).parts[0] for path in project_files() if path[0] != "."} == {
        "LICENSE", "README.md", "blender_addon", "blender_manifest.toml", "docs", "lfsr_core", "pyproject.toml",
        "scripts", "tests"}


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """A fresh environment that sees this one's libraries, with the package installed from a copy of the repository."""
    folder = tmp_path_factory.mktemp("packaging")
    for path in project_files():
        (folder / "copy" / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / path, folder / "copy" / path)
    venv.create(folder / "venv")
    # A plain line adds the folder without reading its own .pth files: an editable install there stays unseen.
    packages(folder / "venv").joinpath("libraries.pth").write_text(sysconfig.get_paths()["purelib"] + "\n")
    run(sys.executable, "-m", "pip", "--python", folder / "venv/bin/python", "install", "-q", "--no-index", "--no-deps",
        "--no-build-isolation", "--ignore-installed", folder / "copy", folder / "copy/scripts/lab", cwd=folder)
    shutil.rmtree(folder / "copy")
    return folder / "venv"


def packages(environment: Path) -> Path:
    return Path(sysconfig.get_path("purelib", "venv", {"base": str(environment)}))


def run(*command: object, cwd: Path) -> str:
    """Standard output of a command that knows nothing of the clone."""
    variables = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(list(map(str, command)), cwd=cwd, env=variables, capture_output=True, text=True, timeout=120,
                          check=False)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    return done.stdout


def test_every_file_is_installed_and_the_command_answers_outside_the_clone(environment, tmp_path):
    assert [path for path in installed_paths() if not (packages(environment) / path).is_file()] == []
    folders = {PurePosixPath(path).parent for path in installed_paths() if path.endswith(".py")}
    assert [folder for folder in folders if f"{folder}/__init__.py" not in installed_paths()] == []
    for arguments, answer in [(("displays",), "bupt-32in-8k"), (("study", "stress", "--help"), "--sweeps")]:
        assert answer in run(environment / "bin/lfsr", *arguments, cwd=tmp_path)


@pytest.mark.slow
@needs_bpy
def test_a_scene_of_the_package_renders_outside_the_clone(environment, tmp_path):
    scenes = packages(environment) / "lfsr_lab" / "scenes"
    run(environment / "bin/python", scenes / "demo_scene.py", "scene.blend", cwd=tmp_path)
    run(environment / "bin/lfsr", "render", "scene.blend", "-o", "frame", "--display", "mini", "--spp", 1, cwd=tmp_path)
    picture = read_png(tmp_path / "frame" / "eia.png")
    assert picture.shape[1::-1] == load_display("mini").panel_pixels and picture.std() > 10


@needs_bpy
def test_scene_scripts_find_the_core_where_they_are_installed(environment, tmp_path):
    """Under another name than __main__ a script only imports what it needs."""
    folder = packages(environment) / "lfsr_lab" / "scenes"
    names = ("training", "sweep", "animation", "unseen", "deep")
    scripts = [str(folder / f"{name}_scenes.py") for name in names] + [str(folder / "move_camera_array.py")]
    code = f"""import runpy, sys
path = list(sys.path)
for script in {scripts!r}:
    sys.path[:] = path
    for name in [name for name, module in sys.modules.items() if {str(environment)!r} in str(module)]:
        del sys.modules[name]
    sys.argv = [script]
    runpy.run_path(script)
    import lfsr_core
    print(lfsr_core.__file__)"""
    paths = run(environment / "bin/python", "-c", code, cwd=tmp_path).split()
    assert len(paths) == len(scripts) and all(path.startswith(str(packages(environment))) for path in paths)
