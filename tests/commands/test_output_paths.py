"""Where nothing can be written to, a run ends with one sentence before any time is spent."""

import os
import re
import subprocess
import sys

import pytest

from tests.support.synthetic import fails

LFSR = [sys.executable, "-m", "lfsr_core.cli"]


@pytest.mark.parametrize(("name", "message"), [
    ("link", "is a link to .*nowhere, which does not exist"), ("link/frame", "link is a link to"),
    ("x" * 256, "too long"), ("ä" * 128, "too long"), (os.fsdecode(b"r\xff"), "not UTF-8"),
    ("/".join(["y" * 99] * 41), "too long")])
@pytest.mark.parametrize("verb", ["render", "reference", "plan"])
def test_output_that_cannot_be(tmp_path, capsys, verb, name, message):
    scene = tmp_path / "scene.glb"
    scene.touch()
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    option = "--work" if verb == "plan" else "-o"
    sentence = fails([verb, str(scene), option, str(tmp_path / name), "--blender", "/must/not/run"], capsys)
    assert re.search(message, sentence)
    assert len(sentence) < 330
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link", "scene.glb"]


@pytest.mark.parametrize("length", [246, 255])
def test_name_with_no_room_for_a_hidden_one_beside_it(tmp_path, capsys, length):
    scene = tmp_path / "scene.glb"
    scene.touch()
    sentence = fails(["render", str(scene), "-o", str(tmp_path / ("x" * length)), "--display", "mini"], capsys)
    assert "cannot be made (File name too long)" in sentence


@pytest.mark.parametrize("verb", [["displays"], ["render", "scene.glb", "-o", "out", "--blender", "/must/not/run"]])
@pytest.mark.parametrize("output", ["closed", "full", "unread"])
def test_standard_output_that_cannot_be_written(tmp_path, verb, output):
    (tmp_path / "scene.glb").touch()
    redirect = {"closed": ">&-", "full": "> /dev/full", "unread": ""}[output]
    options = {"cwd": tmp_path, "capture_output": True, "text": True, "env": os.environ | {"PYTHONPATH": os.getcwd()}}
    if output == "unread":
        reader, writer = os.pipe()
        os.close(reader)
        options |= {"capture_output": False, "stdout": writer, "stderr": subprocess.PIPE}
    done = subprocess.run(["sh", "-c", f'exec "$@" {redirect}', "sh", *LFSR, *verb], check=False, **options)
    assert done.returncode == 2, done
    assert done.stderr.count("\n") == 1, done.stderr
    assert "output" in done.stderr and "must/not/run" not in done.stderr
    assert not (tmp_path / "out").exists()


def test_closed_standard_error_stops_nothing(tmp_path):
    done = subprocess.run(["sh", "-c", 'exec "$@" 2>&-', "sh", *LFSR, "displays"], capture_output=True, text=True,
                          check=False)
    assert done.returncode == 0 and "mini" in done.stdout


def test_output_that_is_a_full_disk_is_one_sentence(tmp_path):
    """A file size limit of the process stands for the disk."""
    script = ("import resource, sys; from lfsr_core.cli import main; "
              "resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100)); sys.exit(main(['displays']))")
    with (tmp_path / "printed").open("w") as printed:
        done = subprocess.run([sys.executable, "-c", script], stdout=printed, stderr=subprocess.PIPE, text=True,
                              check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1 and "free some space" in done.stderr, done.stderr
