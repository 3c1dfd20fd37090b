"""The scripts that need nothing but Python: set-up, demo and tests, as the README names them."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = ROOT / "scripts"
RECORDING = """#!/bin/sh
echo "$(basename "$0") $*" >> "{log}"
test "$(basename "$0") $1" != "{fails}"
"""
spec = importlib.util.spec_from_file_location("lfsr_setup", SCRIPTS / "setup.py")
setup = importlib.util.module_from_spec(spec)
spec.loader.exec_module(setup)


def run(script, *arguments, **variables):
    """The script, as a person runs it."""
    return subprocess.run([sys.executable, SCRIPTS / script, *arguments], capture_output=True, text=True,
                          env=os.environ | variables, check=False, timeout=300, errors="replace")


@pytest.fixture
def played(tmp_path):
    """An environment that is there already, whose programs write down how they are called; played(fails)."""
    folder, log = tmp_path / "environment", tmp_path / "log"
    (folder / "bin").mkdir(parents=True)
    for extras in ("blender,flip", "blender,dev,lab"):
        (folder / f".lfsr-{setup._state(extras)}").touch()

    def make(fails=""):
        for name in ("python", "ruff", "lint-imports", "lfsr"):
            program = folder / "bin" / name
            program.write_text(RECORDING.format(log=log, fails=fails))
            program.chmod(0o755)
        return folder

    make.calls = lambda: log.read_text().splitlines()
    return make


def test_an_environment_that_is_there_is_printed(played):
    folder = played()
    for command in ([sys.executable, SCRIPTS / "setup.py"], [SCRIPTS / "setup.sh"]):
        done = subprocess.run(command, capture_output=True, text=True, env=os.environ | {"LFSR_VENV": str(folder)},
                              check=True)
        assert (done.stdout, done.stderr) == (f"{folder}\n", "")


@pytest.mark.parametrize("make", [lambda played, _: played("python -m"), pytest.param(
    lambda _, folder: folder / "new", marks=pytest.mark.long)], ids=["played", "real"])
def test_installation_that_fails_is_tried_again_next_time(played, tmp_path, make):
    folder = make(played, tmp_path)
    done = run("setup.py", "blender", LFSR_VENV=str(folder), PIP_NO_INDEX="1", PIP_CONFIG_FILE=os.devnull)
    assert done.returncode != 0 and done.stdout == ""
    assert (folder / "bin" / "python").exists() and not (folder / f".lfsr-{setup._state('blender')}").exists()


def test_missing_library_is_named_with_its_package(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("LFSR_VENV", str(tmp_path / "none"))
    monkeypatch.setitem(setup.LIBRARIES, "libnothing.so.9", "libnothing9")
    with pytest.raises(SystemExit, match="2"):
        setup.ready("blender")
    assert "apt-get install -y libnothing9\n" in capsys.readouterr().err and not list(tmp_path.iterdir())
    assert setup.missing_packages([sys.executable]) == ["libnothing9"]


@pytest.mark.parametrize(("platform", "command"), [("linux", "apt-get install -y python3.11 python3.11-venv"),
    ("win32", "winget install Python.Python.3.11"), ("darwin", "brew install python@3.11")])
def test_missing_python_is_said_with_what_installs_it(monkeypatch, tmp_path, platform, command):
    monkeypatch.setenv("LFSR_VENV", str(tmp_path / "none"))
    monkeypatch.setattr(setup, "SUITS", "import sys; sys.exit(1)")
    monkeypatch.setattr(setup.sys, "platform", platform)
    with pytest.raises(setup.SetupError, match=rf"(?s)Python 3\.11 is missing.*{command}"):
        setup.environment("dev")


def test_tests_check_everything_in_turn_and_the_fast_ones_are_folders_that_exist_and_start_no_blender(played):
    folder = played()
    assert run("test.py", LFSR_VENV=str(folder)).returncode == 0
    types = [f"python -m mypy --platform {name} --cache-dir .mypy_cache/{name}"
             + " --no-site-packages --disable-error-code=unused-ignore lfsr_core blender_addon" * (name != sys.platform)
             for name in ("darwin", "linux", "win32")]
    assert [*(calls := played.calls())[:2], *sorted(calls[2:-1]), calls[-1]] == [
        "ruff check .", "lint-imports ", *types, "python -m pytest --collect-only",
        "python -m pytest --numprocesses=3 --dist=worksteal"]
    folder = played("lint-imports ")
    assert run("test.py", LFSR_VENV=str(folder)).returncode == 1
    assert played.calls()[-2:] == ["ruff check .", "lint-imports "]
    folder = played()
    assert run("test.py", "tests/optics", "-k", "weave", LFSR_VENV=str(folder)).returncode == 0
    assert played.calls()[-1] == "python -m pytest tests/optics -k weave"
    assert run("test.py", "--fast", LFSR_VENV=str(folder)).returncode == 0
    *_, types, tests = played.calls()
    assert types.split()[2:5] == ["mypy", "--platform", sys.platform]
    places = [word for word in [word.removeprefix("--ignore=") for word in tests.split()] if word.startswith("tests/")]
    assert len(places) > 9 and all((ROOT / place).exists() for place in places) and "tests/blender" not in places


def test_demo_takes_every_step(played, tmp_path):
    folder, output = played(), tmp_path / "demo"
    done = run("demo.py", str(output), LFSR_VENV=str(folder), PYTHONIOENCODING="latin-1")
    assert done.returncode == 0 and f"The images are in {output / 'frame'}" in done.stdout
    assert [call.split()[1] for call in played.calls() if call.startswith("lfsr")] == [
        "render", "views", "view", "reference", "compare"]
    assert played.calls()[0].endswith(f"demo_scene.py {output / 'scene.blend'}")
    done = run("demo.py", str(tmp_path / "demo"), LFSR_VENV=str(played("lfsr views")))
    assert done.returncode == 1 and "Done" not in done.stdout
    assert played.calls()[-1].startswith("lfsr views")


def test_scripts_need_only_the_standard_library():
    for name in ("setup.py", "demo.py", "test.py"):
        code = (f"import runpy, sys; sys.path.append({str(SCRIPTS)!r}); runpy.run_path({str(SCRIPTS / name)!r}); "
                "loaded = {name.split('.')[0] for name in sys.modules} - sys.stdlib_module_names; "
                "print(sorted(loaded - {'__main__', 'setup'}))")
        done = subprocess.run([sys.executable, "-I", "-S", "-c", code], capture_output=True, text=True, check=True)
        assert done.stdout == "[]\n", name
