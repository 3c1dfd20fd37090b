"""Frames of an animation: each is made once, a broken one again, whatever ended the run before."""

import contextlib
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

from lfsr_core.base.messages import Notice, Progress
from lfsr_core.base.system import staging_folder
from lfsr_core.cli import main
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.frames.frame import Finish, read_frame, read_report, write_frame
from lfsr_core.pipeline.make import FAILED, KEPT, MADE, make, requests_of
from lfsr_core.reconstruct.methods.denoise import LIBRARY_VARIABLE
from lfsr_core.reconstruct.second_stage import finish_frame
from tests.support.animations import FINISH, film, film_request, images, states
from tests.support.played_blender import changed_blender, cold_blender, played_blender
from tests.support.synthetic import fails
from tests.support.told import refuses

FRAMES = range(1, 4)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder, told = tmp_path_factory.mktemp("finished"), []
    return folder, film(folder, FRAMES, blender=played_blender(folder / "blender"), chunk=2, tell=told.append), told


@pytest.fixture
def made(finished, tmp_path):
    """A folder with a finished film of its own; its scene has the size and time of the first one's."""
    return shutil.copytree(finished[0], tmp_path / "own")


def test_every_frame_is_made_once_and_progress_never_falls(finished):
    folder, made, told = finished
    assert states(made) == [MADE] * 3 and [result.frame for result in made] == list(FRAMES)
    assert all(result.render > 0 and result.finish > 0 for result in made)
    assert sorted(path.name for path in (folder / "film").iterdir()) == [f"000{frame}" for frame in FRAMES]
    fractions = [message.fraction for message in told if isinstance(message, Progress)]
    assert fractions == sorted(fractions) and fractions[-1] == 1
    assert states(film(folder, [*FRAMES, 1])) == [KEPT] * 3 and make([]) == []


def test_an_image_is_an_animation_of_one_frame(made):
    """The same bytes, in the output itself; made once, anew where it is asked for, and another one is refused."""
    request, blender = film_request(made, output=str(made / "one"), frame=2), played_blender(made / "blender")
    assert states(make(request, FINISH, blender=blender)) == [MADE]
    assert (made / "one" / "eia.png").read_bytes() == images(made / "film")["0002"]
    assert states(make(request, FINISH)) == [KEPT] and states(make(request)) == [KEPT]
    assert states(make(request, FINISH, blender=blender, overwrite=True)) == [MADE]
    refuses("scale 4", make, request.sampled(scale=4), FINISH)
    assert states(make(request.sampled(scale=4), FINISH, blender=blender, lenient=True)) == [MADE]


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-30])


def pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


@pytest.mark.parametrize(("damage", "renders"), [(lambda folder: pipe(folder / "lr_eia.exr"), True),
    (lambda folder: (folder / "lr_eia.exr").unlink(), True), (lambda folder: cut(folder / "lr_eia.exr"), True),
    (lambda folder: cut(folder / "frame.json"), True), (lambda folder: (folder / "eia.png").unlink(), False),
    (lambda folder: cut(folder / "eia.png"), False), (lambda folder: pipe(folder / "eia.png"), False),
    (lambda folder: (folder / "report.json").write_text("{}"), False)])
def test_a_broken_frame_is_made_again_and_one_that_lacks_its_picture_not_rendered(made, damage, renders):
    before = images(made / "film")
    damage(made / "film" / "0002")
    blender = played_blender(made / "blender") if renders else "/must/not/run"
    assert states(film(made, FRAMES, blender=blender, chunk=2)) == [KEPT, MADE, KEPT]
    assert images(made / "film") == before and len(before) == 3


def test_frames_of_another_render_are_refused_replaced_or_made_again(made):
    assert states(film(made, FRAMES, Finish("nearest"))) == [MADE] * 3
    refuses("seed 5.*overwrite", film, made, FRAMES, changes={"seed": 9})
    assert states(film(made, FRAMES, changes={"seed": 9}, blender=played_blender(made / "blender"),
                       lenient=True)) == [MADE] * 3
    before = images(made / "film")
    assert states(film(made, FRAMES, changes={"seed": 7}, blender=played_blender(made / "blender"),
                       overwrite=True)) == [MADE] * 3
    after = images(made / "film")
    assert all(after[name] != before[name] for name in before)


def test_one_scale_for_all_frames_is_that_of_frames_there_or_chosen_by_the_depth_of_a_few(made, tmp_path):
    request = film_request(made, scale=4, scales=(4, 2), frames=(1,), rays=4.0)

    def sampling(asked, **options):
        return {one.sampling for one in requests_of(asked, FINISH, (7, 8), **options)}
    [kept] = sampling(request)
    assert (kept.scale, kept.scales, kept.frames, kept.samples, kept.rays) == (2, (), (), 16, None)
    other = dataclasses.replace(request, output=str(made / "other"))
    for asked in (sampling(other), sampling(request.sampled(scales=(4, 8))), sampling(request, overwrite=True)):
        assert len(asked) == 1 and asked.pop().scales
    request = film_request(tmp_path, scales=(4, 2), rays=1.0)
    assert {asked.sampling.frames for asked in requests_of(request, FINISH, range(1, 10))} == {(1, 3, 5, 7, 9)}
    request = request.sampled(frames=(2, 3))
    assert {asked.sampling.frames for asked in requests_of(request, FINISH, range(1, 10))} == {(2, 3)}


def test_frames_at_scale_1_are_denoised_alone(tmp_path):
    options = {"finish": Finish("oidn+pool"), "changes": {"scale": 1}}
    assert states(film(tmp_path, (1,), blender=played_blender(tmp_path / "blender"), **options)) == [MADE]
    assert FrameFolder(tmp_path / "film" / "0001").report.method == "oidn"
    assert states(film(tmp_path, (1,), **options)) == [KEPT]


def test_frames_of_a_scene_that_has_changed_are_refused_or_told(made):
    folder, told = FrameFolder(made / "film" / "0002"), []
    write_frame(folder.path, dataclasses.replace(folder.frame, content="of yesterday"))
    refuses("0002.*changed", film, made, FRAMES)
    assert states(film(made, FRAMES, lenient=True, tell=told.append)) == [KEPT] * 3
    assert [message.values for message in told if isinstance(message, Notice)] == [{"count": 1, "first": 2}]
    refuses("0001 is a frame folder itself", film, made, (1,), changes={"output": str(made / "film" / "0001")})


def crashing(path: Path, frames: tuple[int, ...], times: int) -> str:
    """A played Blender that crashes at some frames, the first few ``times``."""
    return changed_blender(path, f"""
first = json.loads(Path(sys.argv[sys.argv.index("--") + 1]).read_text())["frame"]
marks = Path(here + f".{{first}}")
seen = marks.stat().st_size if marks.exists() else 0
if first in {frames!r} and seen < {times}:
    marks.write_text("x" * (seen + 1))
    os.kill(os.getpid(), signal.SIGSEGV)""")


def test_a_frame_that_crashed_once_is_tried_again_and_one_that_always_crashes_left_out(tmp_path, capsys):
    (tmp_path / "once").mkdir()
    blender = crashing(tmp_path / "once" / "blender", (1, 2), 1)
    assert states(film(tmp_path / "once", (1, 2), blender=blender, chunk=1)) == [MADE, MADE]
    assert not list((tmp_path / "once" / "film").rglob("blender.log"))
    told, blender = [], crashing(tmp_path / "blender", (2,), 99)
    made = film(tmp_path, FRAMES, blender=blender, tell=told.append, chunk=1)
    assert states(made) == [MADE, FAILED, MADE] and "signal 11" in made[1].error
    assert [told.values["frame"] for told in told if isinstance(told, Notice)] == [2]
    command = ["render", str(tmp_path / "scene.glb"), "-o", str(tmp_path / "again"), "--frames", "1-2", "--display",
               "mini", "--scale", "2", "--method", "bicubic", "--blender", blender]
    late = changed_blender(tmp_path / "late", "if os.fork():\n    os.wait()\n    sys.exit(9)")
    refuses("stopped with exit code 9", film, tmp_path, (7,), blender=late)
    # Both frames are in one chunk, which begins with the first.
    assert main(command) == 0
    table = capsys.readouterr().out
    assert re.search(r"\n +2  made +[\d.]+ s +[\d.]+ s\n2 frames: 2 made, 0 kept, 0 failed, in \d+ s\n$", table), table


def test_a_frame_that_cannot_be_finished_does_not_stop_the_others(made):
    for name in ("0001", "0002"):
        (made / "film" / name / "eia.png").unlink()
    (made / "film" / "0001" / "eia.png" / "x").mkdir(parents=True)
    results = film(made, FRAMES)
    assert states(results) == [FAILED, MADE, KEPT] and "eia.png cannot be written" in results[0].error


def test_a_frame_that_another_process_renders_does_not_stop_the_others(made):
    with staging_folder(made / "film" / "0002"):
        results = film(made, [1, 2], blender=played_blender(made / "blender"), overwrite=True)
    assert states(results) == [MADE, FAILED] and "another process is writing" in results[1].error


@pytest.mark.parametrize(("options", "sentence"), [
    (["--frames", "x"], "frames are 'x'"), (["--frames", "1", "--frame", "2"], "--frames 1 and --frame were both"),
    (["--frames", "1", "--rows", "1-2"], "--frames 1 and --rows were both"),
    (["--temporal-averaging", "1"], "without --frames"), (["--frames", "1-3", "--temporal-averaging", "9"], "0 to 8"),
    (["--frame", "2", "--temporal-averaging", "9"], "0 to 8"),
    (["--frames", "1-3", "--temporal-averaging", "1", "--cluster", "tcp://x"], "cluster"),
    (["--method", "oidn", "--scale", "1", "--frames", "1-3"], "Open Image Denoise is not available"),
    (["--method", "denoise+pool", "--weights", "typo.tza"], "typo.tza does not exist"),
    (["--method", "pool", "--weights", "a.tza"], "'pool' has none"), (["--check", "9"], "film_reference is a file")])
def test_bad_arguments(tmp_path, capsys, monkeypatch, options, sentence):
    if "oidn" in options:
        monkeypatch.setenv(LIBRARY_VARIABLE, "/nowhere")
    for name in ("scene.glb", "film_reference"):
        (tmp_path / name).touch()
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
    blender = Path(cold_blender(tmp_path / "blender"))
    blender.write_text(blender.read_text().replace(IMPORT, IMPORT + SLOW))
    film_request(tmp_path)
    output = tmp_path / "film"
    command = [sys.executable, "-m", "lfsr_core", "render", str(tmp_path / "scene.glb"), "-o", str(output),
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
    rendered = {name: (output / name / "lr_eia.exr").stat().st_mtime_ns for name in ("0001",)}
    assert not (output / "0003").exists()
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert re.search(r"3 frames: \d made, \d kept, 0 failed", done.stdout), done.stdout
    assert {name: (output / name / "lr_eia.exr").stat().st_mtime_ns for name in rendered} == rendered
    assert sorted(path.name for path in output.iterdir()) == [f"000{frame}" for frame in FRAMES]
    assert all(json.loads((output / f"000{frame}" / "frame.json").read_text())["frame"] == frame for frame in FRAMES)


AVERAGED = Finish("bicubic", temporal_averaging=1)


def neighbours(folder):
    return [read_report(path).neighbours for path in sorted((folder / "film").glob("0*"))]


def test_averaged_frames_have_noise_of_their_own_see_those_beside_them_and_no_frame_of_another_seed(tmp_path):
    film(tmp_path, range(1, 4), AVERAGED, blender=played_blender(tmp_path / "blender"), chunk=2)
    frames = [read_frame(path) for path in sorted((tmp_path / "film").glob("0*"))]
    assert [frame.seed for frame in frames] == [5, 6, 7], "one for each averaged frame, from the job's on"
    assert neighbours(tmp_path) == [(2, 3), (1, 3), (1, 2)]
    assert {request.seed for request in requests_of(film_request(tmp_path), FINISH, range(1, 4))} == {5}
    refuses("seed 6.*seed 5", film, tmp_path, (2,))
    assert states(film(tmp_path, range(1, 4), AVERAGED)) == [KEPT] * 3
    made = film(tmp_path, range(1, 5), AVERAGED, blender=str(tmp_path / "blender"))
    assert states(made) == [KEPT, KEPT, MADE, MADE] and neighbours(tmp_path) == [(2, 3), (1, 3), (2, 4), (2, 3)]
    before = images(tmp_path / "film")
    with contextlib.chdir(tmp_path / "film" / "0002"):
        finish_frame(".", AVERAGED)
    assert images(tmp_path / "film") == before
    finish_frame(tmp_path / "film" / "0002", FINISH)
    assert images(tmp_path / "film")["0002"] != before["0002"]
    for output in ("film", "film/0002"):
        shutil.rmtree(tmp_path / "film" / "0002")
        assert main(["render", str(tmp_path / "scene.glb"), "-o", str(tmp_path / output), "--frame", "2", "--seed", "5",
                     "--temporal-averaging", "1", "--display", "mini", "--scale", "2", "--method", "bicubic",
                     "--blender", str(tmp_path / "blender")]) == 0
        assert neighbours(tmp_path)[1] == (1, 3) and read_frame(tmp_path / "film" / "0002").seed == 6
