"""A shot on real worker processes: the same pictures, whoever dies, and a sentence where a worker sees nothing."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from lfsr_core.cli import main
from lfsr_core.errors import LfsrError
from lfsr_core.sequence.cluster import PLACE_FILE, RESOURCE, Cluster, render_on
from lfsr_core.sequence.engine import KEPT, MADE, Tools, render_shot
from tests.support.played_blender import played_blender
from tests.support.shots import pictures, shot
from tests.support.synthetic import fails

distributed = pytest.importorskip("distributed") if not os.environ.get("CI") else __import__("distributed")
FRAMES = range(1, 4)


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    """Address of a scheduler with two workers that declare the resource, and the workers' processes."""
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, resources={RESOURCE: 1}, dashboard_address=None,
                                  processes=True) as cluster:
        yield cluster


@pytest.fixture
def tools(tmp_path):
    return Tools(played_blender(tmp_path / "blender"), chunk=1)


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """Pictures of one process."""
    folder = tmp_path_factory.mktemp("alone")
    render_shot(shot(folder, FRAMES), Tools(played_blender(folder / "blender")))
    return pictures(folder / "film")


def states(results):
    return [result.state for result in results]


def test_workers_make_the_pictures_of_one_process(scheduler, tmp_path, tools, alone):
    seen = []
    told = Tools(tools.blender, lambda *state: seen.append(state), chunk=1)
    results = render_on(Cluster(scheduler.scheduler_address), shot(tmp_path, FRAMES), told)
    assert states(results) == [MADE] * 3 and [result.frame for result in results] == list(FRAMES)
    assert pictures(tmp_path / "film") == alone
    assert seen[-1] == ("frames", 1.0, "3 of 3")
    assert sorted(path.name for path in (tmp_path / "film").iterdir()) == ["0001", "0002", "0003"]
    again = render_on(Cluster(scheduler.scheduler_address), shot(tmp_path, FRAMES), Tools("/must/not/run"))
    assert states(again) == [KEPT] * 3


def slow(path: Path) -> str:
    """A played Blender that says by a file of its process's name that it is at work, and takes its time."""
    inner = played_blender(path.with_name("inner"))
    path.write_text(f"#!{sys.executable}\nimport os, sys, time\nif '--version' not in sys.argv:\n"
                    f"    open({str(path)!r} + f'.{{os.getppid()}}.pid', 'w').close()\n    time.sleep(1.5)\n"
                    f"os.execv({inner!r}, sys.argv)\n")
    path.chmod(0o755)
    return str(path)


def kill_first_worker(folder: Path, killed: list[int]) -> None:
    """Kill the first worker that has begun a frame."""
    while not killed:
        for path in folder.glob("blender.*.pid"):
            killed.append(int(path.suffixes[-2][1:]))
            os.kill(killed[0], signal.SIGKILL)
            return
        time.sleep(0.02)


@pytest.mark.skipif(sys.platform == "win32", reason="kills")
def test_a_dead_workers_frames_are_made_by_others(scheduler, tmp_path, alone):
    killed: list[int] = []
    thread = threading.Thread(target=kill_first_worker, args=(tmp_path, killed), daemon=True)
    thread.start()
    results = render_on(Cluster(scheduler.scheduler_address), shot(tmp_path, FRAMES),
                        Tools(slow(tmp_path / "blender"), chunk=1))
    thread.join(5)
    assert killed and states(results) == [MADE] * 3 and pictures(tmp_path / "film") == alone
    assert len(list(tmp_path.glob("blender.*.pid"))) >= 2, "another worker has taken over"


@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
def test_a_worker_that_does_not_see_the_folder(scheduler, tmp_path):
    """What lies behind a descriptor of this process nobody else sees under that name."""
    shown = os.open(tmp_path, os.O_RDONLY)
    try:
        with pytest.raises(LfsrError, match=r"the worker tcp://\S+ does not see the folder /proc/\S+/film: share"):
            render_on(Cluster(scheduler.scheduler_address), shot(Path(f"/proc/self/fd/{shown}"), FRAMES),
                      Tools("/must/not/run"))
    finally:
        os.close(shown)
    assert list((tmp_path / "film").iterdir()) == [], "no mark is left"


def test_blenders_own_sentence_arrives(scheduler, tmp_path):
    with pytest.raises(LfsrError, match="'/must/not/run' was not found"):
        render_on(Cluster(scheduler.scheduler_address), shot(tmp_path, (1,)), Tools("/must/not/run"))


def test_the_command_on_workers_of_this_machine(tmp_path, alone):
    blender = played_blender(tmp_path / "blender")
    (tmp_path / "scene.glb").write_text("a scene")
    command = [sys.executable, "-m", "lfsr_core.cli", "render", str(tmp_path / "scene.glb"), "-o", "film", "--frames",
               "1-3", "--display", "mini", "--scale", "2", "--spp", "16", "--seed", "5", "--method", "bicubic",
               "--blender", blender, "--workers", "2"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False,
                          env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))})
    assert done.returncode == 0, done.stderr
    assert "3 frames: 3 made, 0 kept, 0 failed" in done.stdout and "Traceback" not in done.stderr
    assert pictures(tmp_path / "film") == alone
    assert not list((tmp_path / "film").glob(f"{PLACE_FILE}*"))


@pytest.mark.parametrize(("options", "sentence"), [
    (["--workers", "2"], "--workers was given without --frames"), (["--overwrite"], "--overwrite was given without"),
    (["--frames", "1", "--workers", "0"], "workers are 0, but they must be 1 to 256"),
    (["--frames", "1", "--workers", "2", "--cluster", "tcp://x"], "--workers 2 and --cluster were both given"),
    (["--frames", "1", "--cluster", "nonsense://x"], "nonsense://x cannot be reached as a Dask scheduler")])
def test_bad_arguments(tmp_path, capsys, options, sentence):
    (tmp_path / "scene.glb").touch()
    said = fails(["render", str(tmp_path / "scene.glb"), "-o", str(tmp_path / "film"), "--display", "mini", *options],
                 capsys)
    assert sentence in said


def test_main_is_the_same_without_dask(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "dask", None)
    (tmp_path / "scene.glb").touch()
    assert main(["render", str(tmp_path / "scene.glb"), "-o", str(tmp_path / "film"), "--display", "mini", "--frames",
                 "1", "--workers", "2"]) == 2
    assert "install the extra 'farm'" in capsys.readouterr().err
