"""Blender as a child process, played by small scripts that behave well, badly, or not at all."""

import importlib.util
import json
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from lfsr_core.base.messages import LfsrError, Notice, Progress
from lfsr_core.base.records import to_data
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.frames.frame import LOG_FILE, LOW_RES_FILE, REFERENCE_FILES, REPORT_FILE, Request
from lfsr_core.optics.display import load_display
from lfsr_core.pipeline import make
from lfsr_core.pipeline.make import render_all
from lfsr_core.process import child
from lfsr_core.process.child import Blender, find_blender, parse_progress
from tests.support.processes import wait_for
from tests.support.requests import make_request
from tests.support.small_disk import on_a_small_disk
from tests.support.told import refuses

READ_JOB = "import json, os, sys, time\nfrom pathlib import Path\njob = json.loads(Path(sys.argv[-1]).read_text())\n"
GOOD = """
print("Fra:1 Mem:20M", flush=True)
print('LFSR {"stage": "render", "fraction": 0.5, "message": "half"}', flush=True)
Path(job["output"], "lr_eia.exr").write_text("new")
print('LFSR {"stage": "rendered"}')
print('LFSR {"stage": "done", "folder": "."}')
"""


@pytest.fixture
def blender(tmp_path):
    """Function that makes an executable `blender` from the body of a Python script."""
    def make(body: str, version: str = "Blender 4.5.15 LTS", name: str = "blender") -> str:
        path = tmp_path / "bin" / name
        path.parent.mkdir(exist_ok=True)
        answer = f"import sys\nif '--version' in sys.argv:\n    print({version!r})\n    sys.exit()\n"
        path.write_text(f"#!{sys.executable} -S\n" + answer + READ_JOB + textwrap.dedent(body))
        path.chmod(0o755)
        return str(path)
    return make


@pytest.fixture
def job(tmp_path):
    return make_request(str(tmp_path / "work" / "frame"), load_display("mini"))


def leftovers(job: Request) -> list[str]:
    """Everything beside and inside the frame folder."""
    parent = Path(job.output).parent
    return sorted(str(path.relative_to(parent)) for path in parent.rglob("*")) if parent.exists() else []


def with_wheel(monkeypatch, spec: object, real=importlib.util.find_spec) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: spec if name == "bpy" else real(name))


def test_the_wheel_then_the_path_but_first_what_is_asked_for(monkeypatch, blender):
    path = blender(GOOD)
    monkeypatch.setenv("PATH", os.path.dirname(path))
    with_wheel(monkeypatch, object())
    assert find_blender() == Blender(None) and find_blender().command(Path("job.json"))[0] == sys.executable
    mine = blender(GOOD, name="blender-mine")
    assert find_blender(mine) == Blender(mine)
    with_wheel(monkeypatch, None)
    assert find_blender() == Blender(path)
    command = find_blender().command(Path("job.json"))
    assert command[:2] == [path, "--background"] and command[-2:] == ["--", "job.json"]
    assert Path(command[command.index("--python") + 1]).name == "from_sources.py"


def test_the_newest_installed_blender_and_that_inside_a_bundle_of_macos_are_found(monkeypatch, tmp_path, blender):
    with_wheel(monkeypatch, None)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("ProgramFiles", f"{tmp_path}/Program Files")
    monkeypatch.setattr(child, "PLACES", {sys.platform: child.PLACES["win32"]})
    for version in ("4.5", "10.1", "5.0"):
        folder = tmp_path / "Program Files" / "Blender Foundation" / f"Blender {version}"
        folder.mkdir(parents=True)
        Path(blender(GOOD, f"Blender {version}.2")).rename(folder / "blender.exe")
    assert find_blender() == Blender(f"{tmp_path}/Program Files/Blender Foundation/Blender 10.1/blender.exe")
    inside = tmp_path / "Blender.app" / "Contents" / "MacOS" / "Blender"
    inside.parent.mkdir(parents=True)
    Path(blender(GOOD)).rename(inside)
    assert find_blender(f"{tmp_path}/Blender.app/") == Blender(f"{tmp_path}/Blender.app/Contents/MacOS/Blender")


def test_missing_unsuitable_and_newer_blenders(monkeypatch, tmp_path, blender):
    with_wheel(monkeypatch, None)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(child, "PLACES", {})
    refuses("neither the bpy package nor an installed Blender", find_blender)
    refuses("'/no/blender' was not found", find_blender, "/no/blender")
    for version, message in [
        ("Blender 4.4.3", r"is Blender 4\.4, but 4\.5 or newer is needed"), ("Blender 3.6.0", r"is Blender 3\.6"),
        ("GNU bash 5.2", "does not say that it is Blender")]:
        refuses(message, find_blender, blender(GOOD, version))
    for version in ["Blender 4.5.0", "Blender 5.0.1", "Blender 10.1.0 Alpha"]:
        path = blender(GOOD, version)
        assert find_blender(path) == Blender(path)


@pytest.mark.parametrize(("line", "record"), [
    ('LFSR {"stage": "render", "fraction": 0.25}', {"stage": "render", "fraction": 0.25}), ("LFSR {half", None),
    ("LFSR [1]", None), ('LFSR {"fraction": 1}', None),
    ('Error: ... truncatedLFSR {"stage": "error"}\n', {"stage": "error"}),
    ('LFSR {"stage": "render"} x', {"stage": "render"}), ("x LFSR " + '{"stage": ' * 9999, None),
    ("Fra:1 Mem:20M", None), ("", None)])
def test_progress_lines(line, record):
    assert parse_progress(line) == record


def test_job_file_asks_for_the_job_and_its_render_is_moved_in_whole(blender, job, tmp_path):
    render_all([job], Blender(blender(f"Path({str(tmp_path / 'copy.json')!r}).write_text(json.dumps(job))" + GOOD)))
    asked = json.loads((tmp_path / "copy.json").read_text())
    assert Path(asked.pop("output")).is_absolute() and asked.pop("parts") == str(FrameFolder(job.output).parts)
    assert asked == {key: value for key, value in to_data(job).items() if key not in ("output", "parts")}
    record, seen = '{"stage": "notice", "notice": "file-unreadable", "values": {"path": "wood.png"}}', []
    render_all([job], Blender(blender(f"print('LFSR {record}')" + GOOD)), seen.append)
    assert seen == [Notice("file-unreadable", {"path": "wood.png"}), Progress("render", 0.5, "half")]
    assert leftovers(job) == ["frame", f"frame/{LOW_RES_FILE}"]


def test_new_render_replaces_what_was_made_from_the_old_one(blender, job):
    folder = Path(job.output)
    folder.mkdir(parents=True)
    for name in (LOW_RES_FILE, REPORT_FILE, "notes.txt"):
        (folder / name).write_text("old")
    render_all([job], Blender(blender(GOOD)))
    assert (folder / LOW_RES_FILE).read_text() == "new"
    assert leftovers(job) == ["frame", f"frame/{LOW_RES_FILE}", "frame/notes.txt"]
    refuses("exit code 1", render_all, [job], Blender(blender("sys.exit(1)")))
    assert (Path(job.output) / LOW_RES_FILE).read_text() == "new"


BAD_INPUT = """
Path(job["output"], "lr_eia.exr").write_text("half")
print('LFSR {"stage": "error", "message": "scene x.blend has no visible subject: show one"}')
sys.exit(2)
"""


def test_bad_input_is_told_in_blenders_sentence_and_a_full_disk_in_ours(blender, job):
    refuses(r"^scene x.blend has no visible subject: show one$", render_all, [job], Blender(blender(BAD_INPUT)))
    assert leftovers(job) == []
    said = on_a_small_disk(50_000, LOG_FILLS_THE_DISK, blender("print('x' * 100_000, flush=True)\n" + GOOD), job.output)
    assert said.startswith("refused: ") and "free some space" in said, said
    assert leftovers(job) == []


@pytest.mark.parametrize(("ending", "message"), [
    ("sys.exit(3)", "exit code 3"), ("os.abort()", "signal 6"),
    ("sys.exit(2)", "exit code 2"),
    ("sys.exit(0)", "exit code 0"),  # without saying that it is done
])
def test_crash_is_reported_with_the_last_lines_and_the_log_is_kept(blender, job, ending, message):
    body = "Path(job['output'], 'lr_eia.exr').write_text('half')\nprint('out of\\nmemory', flush=True)\n" + ending
    with pytest.raises(LfsrError, match=rf"stopped with {message} .*'out of / memory'.*blender.log") as caught:
        render_all([job], Blender(blender(body)))
    assert "\n" not in str(caught.value) and leftovers(job) == ["frame", "frame/blender.log"]


def test_log_of_a_crash_is_not_written_through_a_link(blender, job, tmp_path):
    (tmp_path / "precious").write_text("mine")
    Path(job.output).mkdir(parents=True)
    Path(job.output, LOG_FILE).symlink_to(tmp_path / "precious")
    refuses("exit code 3", render_all, [job], find_blender(blender("sys.exit(3)")))
    assert (tmp_path / "precious").read_text() == "mine" and not Path(job.output, LOG_FILE).is_symlink()


LOG_FILLS_THE_DISK = """
from lfsr_core.optics.display import load_display
from lfsr_core.pipeline.make import render_all
from lfsr_core.process.child import find_blender
from tests.support.requests import make_request
render_all([make_request(sys.argv[3], load_display("mini"))], find_blender(sys.argv[2]))
"""


@pytest.mark.parametrize(("kind", "present"), [("render", REFERENCE_FILES[0]), ("reference", LOW_RES_FILE),
                                               ("render", "world.exr"), ("reference", "view.html")])
def test_another_kind_of_render_and_a_file_of_no_render_are_never_overwritten(blender, tmp_path, kind, present):
    folder = tmp_path / "frame"
    folder.mkdir()
    (folder / present).write_text("hours of work")
    with pytest.raises(LfsrError, match=f"(a {kind} was asked for|but no render).*: choose another"):
        render_all([make_request(str(folder), load_display("mini"), kind=kind, scale=1)], Blender(blender(GOOD)))
    assert (folder / present).read_text() == "hours of work"


def test_output_that_is_a_file_is_refused(blender, tmp_path):
    (tmp_path / "frame").write_text("x")
    with pytest.raises(LfsrError, match="frame is a file, but the output must be a folder"):
        render_all([make_request(str(tmp_path / "frame"), load_display("mini"))], Blender(blender(GOOD)))


SLEEPER = """
Path(job["output"], "lr_eia.exr").write_text("half")
Path(os.environ["PID_FILE"]).write_text(str(os.getpid()))
print('LFSR {"stage": "render", "fraction": 0.1}', flush=True)
sys.stdin.read()
"""


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT])
def test_interrupt_stops_blender_and_leaves_nothing(blender, job, tmp_path, sent):
    pid_file, scene = tmp_path / "pid", tmp_path / "scene.glb"
    scene.touch()
    command = [sys.executable, "-m", "lfsr_core", "render", str(scene), "-o", job.output, "--display", "mini",
               "--method", "bicubic", "--blender", blender(SLEEPER)]
    program = subprocess.Popen(command, cwd=Path(make.__file__).parents[2], stderr=subprocess.PIPE,
                               text=True, env=os.environ | {"PID_FILE": str(pid_file)})
    try:
        wait_for(lambda: pid_file.exists() and pid_file.read_text())
        program.send_signal(sent)
        _, errors = program.communicate(timeout=20)
    finally:
        program.kill()
    assert program.returncode == 130, errors
    assert "interrupted" in errors and "Traceback" not in errors
    wait_for(lambda: not Path(f"/proc/{pid_file.read_text()}").exists())  # Blender must not live on
    assert leftovers(job) == []
