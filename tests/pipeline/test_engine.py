"""Frames of an animation: each is made once, a broken one again, whatever ended the run before."""

from __future__ import annotations

import dataclasses
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.cli import main
from lfsr_core.frames.frame import read_frame, write_frame
from lfsr_core.frames.report import read_report
from lfsr_core.pipeline.animation import SecondStage, kept_scale
from lfsr_core.pipeline.engine import FAILED, KEPT, MADE, Tools, render_animation
from tests.support.animations import animation, images, played_tools, states
from tests.support.played_blender import played_blender
from tests.support.synthetic import fails

FRAMES = range(1, 4)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished")
    results = render_animation(animation(folder, FRAMES), played_tools(folder, 2))
    return folder, results


@pytest.fixture
def made(finished, tmp_path):
    """A folder with a finished film of its own."""
    for name in ("film", "scene.glb"):
        copy = shutil.copytree if name == "film" else shutil.copy2
        copy(finished[0] / name, tmp_path / name)
    return tmp_path


NO_BLENDER = Tools("/must/not/run")


def test_every_frame_is_made_once(finished):
    folder, results = finished
    assert states(results) == [MADE] * 3 and [result.frame for result in results] == list(FRAMES)
    assert all(result.render > 0 and result.finish > 0 for result in results)
    assert sorted(path.name for path in (folder / "film").iterdir()) == [f"000{frame}" for frame in FRAMES]
    assert states(render_animation(animation(folder, FRAMES), NO_BLENDER)) == [KEPT] * 3


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-30])


def pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


DAMAGES = {
    "a pipe for a render": lambda folder: pipe(folder / "lr_eia.exr"),
    "no render": lambda folder: (folder / "lr_eia.exr").unlink(),
    "render cut short": lambda folder: cut(folder / "lr_eia.exr"),
    "frame.json cut short": lambda folder: cut(folder / "frame.json"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_broken_frame_is_made_again(made, damage):
    before = images(made / "film")
    DAMAGES[damage](made / "film" / "0002")
    assert states(render_animation(animation(made, FRAMES), played_tools(made, 2))) == [KEPT, MADE, KEPT]
    assert images(made / "film") == before and len(before) == 3


@pytest.mark.parametrize("damage", [lambda folder: (folder / "eia.png").unlink(),
                                    lambda folder: cut(folder / "eia.png"),
                                    lambda folder: pipe(folder / "eia.png"),
                                    lambda folder: (folder / "report.json").write_text("{}")])
def test_a_frame_that_lacks_its_picture_is_not_rendered_again(made, damage):
    before = images(made / "film")
    damage(made / "film" / "0002")
    assert states(render_animation(animation(made, FRAMES), NO_BLENDER)) == [KEPT, MADE, KEPT]
    assert images(made / "film") == before


def test_another_method_finishes_the_same_renders(made):
    assert states(render_animation(animation(made, FRAMES, SecondStage("nearest")), NO_BLENDER)) == [MADE] * 3


def test_one_scale_for_all_frames_is_chosen_by_the_depth_of_a_few(tmp_path):
    asked = animation(tmp_path, range(1, 10), scales=(4, 2), rays=1.0)
    assert {job.sampling.frames for job in asked.jobs} == {(1, 3, 5, 7, 9)}
    asked = animation(tmp_path, range(1, 10), scales=(4, 2), rays=1.0, scale_frames=(2, 3))
    assert {job.sampling.frames for job in asked.jobs} == {(2, 3)}


def test_frames_that_are_there_decide_the_scale_of_others(made):
    job = dataclasses.replace(animation(made, FRAMES).jobs[0], output=str(made / "film"), scale=4, scales=(4, 2),
                              scale_frames=(1,), rays=4.0)
    kept = kept_scale(job)
    assert (kept.sampling.scale, kept.sampling.scales, kept.sampling.frames, kept.sampling.samples,
            kept.sampling.rays) == (2, (), (), 16, None)
    assert kept_scale(dataclasses.replace(job, output=str(made / "other"))).scales == (4, 2)
    assert kept_scale(job.sampled(scales=(4, 8))).scales == (4, 8)


def test_frames_at_scale_1_are_denoised_alone(tmp_path):
    asked = animation(tmp_path, (1,), SecondStage("oidn+bilinear+epi"), scale=1)
    assert states(render_animation(asked, played_tools(tmp_path, 1))) == [MADE]
    assert read_report(tmp_path / "film" / "0001").method == "oidn"
    assert states(render_animation(asked, NO_BLENDER)) == [KEPT]


def test_overwrite_makes_all_again(made):
    before = images(made / "film")
    again = Tools(played_blender(made / "blender"), overwrite=True)
    assert states(render_animation(animation(made, FRAMES, seed=7), again)) == [MADE] * 3
    after = images(made / "film")
    assert all(after[name] != before[name] for name in before)


def test_frames_of_another_render_are_refused(made):
    with pytest.raises(LfsrError, match="with seed 5, but seed 9 was asked for: give --overwrite"):
        render_animation(animation(made, FRAMES, seed=9), NO_BLENDER)


def test_frames_of_a_scene_that_has_changed_are_refused(made):
    folder = made / "film" / "0002"
    write_frame(folder, dataclasses.replace(read_frame(folder), content="1 of yesterday"))
    with pytest.raises(LfsrError, match="0002 was rendered before .* was changed: give --overwrite"):
        render_animation(animation(made, FRAMES), NO_BLENDER)


def test_a_folder_that_is_a_frame_is_no_place_for_frames(made):
    with pytest.raises(LfsrError, match="0001 is a frame folder itself"):
        animation(made, (1,), output=str(made / "film" / "0001"))


def crashing(path: Path, frames: tuple[int, ...], times: int) -> str:
    """A played Blender that crashes at some frames, the first few ``times``."""
    inner = played_blender(path.with_name("inner"))
    path.write_text(f"""#!{sys.executable}
import json, os, signal, sys
from pathlib import Path
if "--version" not in sys.argv:
    first = json.loads(Path(sys.argv[sys.argv.index("--") + 1]).read_text())["frame"]
    marks = Path({str(path)!r} + f".{{first}}")
    seen = marks.stat().st_size if marks.exists() else 0
    if first in {frames!r} and seen < {times}:
        marks.write_text("x" * (seen + 1))
        os.kill(os.getpid(), signal.SIGSEGV)
os.execv({inner!r}, sys.argv)
""")
    path.chmod(0o755)
    return str(path)


def test_a_frame_that_crashed_once_is_tried_again(tmp_path):
    tools = Tools(crashing(tmp_path / "blender", (1, 2), 1), chunk=1)
    assert states(render_animation(animation(tmp_path, (1, 2)), tools)) == [MADE, MADE]
    assert not list((tmp_path / "film").rglob("blender.log"))


def test_a_frame_that_always_crashes_is_left_out(tmp_path, capsys):
    warned = []
    tools = Tools(crashing(tmp_path / "blender", (2,), 99), warn=warned.append, chunk=1)
    results = render_animation(animation(tmp_path, FRAMES), tools)
    assert states(results) == [MADE, FAILED, MADE]
    assert "signal 11" in results[1].error and len(warned) == 1 and "frame 2 is left out" in warned[0]
    command = ["render", str(tmp_path / "scene.glb"), "-o", str(tmp_path / "again"), "--frames", "1-2", "--display",
               "mini", "--scale", "2", "--method", "bicubic", "--blender", tools.blender]
    # Both frames are in one chunk, which begins with the first.
    assert main(command) == 0
    table = capsys.readouterr().out
    assert re.search(r"\n +2  made +[\d.]+ s +[\d.]+ s\n2 frames: 2 made, 0 kept, 0 failed, in \d+ s\n$", table), table


def test_a_frame_that_cannot_be_finished_does_not_stop_the_others(made):
    for name in ("0001", "0002"):
        (made / "film" / name / "eia.png").unlink()
    (made / "film" / "0001" / "eia.png" / "x").mkdir(parents=True)
    results = render_animation(animation(made, FRAMES), NO_BLENDER)
    assert states(results) == [FAILED, MADE, KEPT] and "eia.png cannot be written" in results[0].error


@pytest.mark.parametrize(("options", "sentence"), [
    (["--frames", "x"], "frames are 'x'"), (["--frames", "1", "--frame", "2"], "--frames 1 and --frame were both"),
    (["--frames", "1", "--rows", "1-2"], "--frames 1 and --rows were both")])
def test_bad_arguments(tmp_path, capsys, options, sentence):
    (tmp_path / "scene.glb").touch()
    said = fails(["render", str(tmp_path / "scene.glb"), "-o", str(tmp_path / "film"), "--display", "mini", "--blender",
                  "/must/not/run", *options], capsys)
    assert sentence in said and not (tmp_path / "film").exists()


IMPORT = "from tests.support import noisy_renders\n"
SLOW = """
import time
real = noisy_renders.render
def render(job):
    time.sleep(0.4)
    real(job)
noisy_renders.render = render
"""


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_an_interrupted_run_loses_only_the_frame_in_work(tmp_path, number):
    blender = Path(played_blender(tmp_path / "blender"))
    blender.write_text(blender.read_text().replace(IMPORT, IMPORT + SLOW))
    animation(tmp_path, FRAMES)
    film = tmp_path / "film"
    command = [sys.executable, "-m", "lfsr_core.cli", "render", str(tmp_path / "scene.glb"), "-o", str(film),
               "--frames", "1-3", "--display", "mini", "--scale", "2", "--method", "bicubic", "--seed", "5",
               "--blender", str(blender)]
    program = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    while not (tmp_path / "film" / "0001" / "frame.json").exists():
        assert program.poll() is None, program.communicate()
        time.sleep(0.02)
    children = Path(f"/proc/{program.pid}/task/{program.pid}/children").read_text().split()
    program.send_signal(number)
    said, _ = program.communicate(timeout=30)
    if number == signal.SIGINT:
        assert program.returncode == 130 and "interrupted" in said and "Traceback" not in said, said
    else:
        os.kill(int(children[0]), signal.SIGKILL)  # the real one ends with its standard input
    rendered = {name: (film / name / "lr_eia.exr").stat().st_mtime_ns for name in ("0001",)}
    assert not (film / "0003").exists()
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert re.search(r"3 frames: \d made, \d kept, 0 failed", done.stdout), done.stdout
    assert {name: (film / name / "lr_eia.exr").stat().st_mtime_ns for name in rendered} == rendered
    assert sorted(path.name for path in film.iterdir()) == [f"000{frame}" for frame in FRAMES]
    assert all(json.loads((film / f"000{frame}" / "frame.json").read_text())["frame"] == frame for frame in FRAMES)
