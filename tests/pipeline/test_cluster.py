"""An animation on real worker processes: the same images, whoever dies, and a sentence where a worker sees nothing."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.base.errors import LfsrError
from lfsr_core.cli import main
from lfsr_core.frames.frame import REFERENCE_FILES, read_part
from lfsr_core.images.exr import read_layers
from lfsr_core.optics.lens_rows import check_cover
from lfsr_core.pipeline import cluster
from lfsr_core.pipeline.cluster import PLACE_FILE, RESOURCE, Cluster
from lfsr_core.pipeline.cluster_animation import render_on
from lfsr_core.pipeline.cluster_reference import ROWS, SAMPLES, Split, part_jobs, reference_on
from lfsr_core.pipeline.engine import KEPT, MADE, Tools, render_animation
from lfsr_core.pipeline.rendering import run_job
from lfsr_core.process.blender import find_blender
from tests.support.animations import animation, images, played_tools, states
from tests.support.noisy_renders import JOB
from tests.support.played_blender import played_blender
from tests.support.synthetic import fails

distributed = pytest.importorskip("distributed") if not os.environ.get("CI") else __import__("distributed")
psutil = pytest.importorskip("psutil")
FRAMES = range(1, 4)


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    """Address of a scheduler with two workers that declare the resource, and the workers' processes."""
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, resources={RESOURCE: 1}, dashboard_address=None,
                                  processes=True) as cluster:
        yield cluster


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """Images of one process."""
    folder = tmp_path_factory.mktemp("alone")
    render_animation(animation(folder, FRAMES), played_tools(folder, 3))
    return images(folder / "film")


def test_workers_make_the_pictures_of_one_process(scheduler, tmp_path, alone):
    seen = []
    told = dataclasses.replace(played_tools(tmp_path, 1), progress=lambda *state: seen.append(state))
    results = render_on(Cluster(scheduler.scheduler_address), animation(tmp_path, FRAMES), told)
    assert states(results) == [MADE] * 3 and [result.frame for result in results] == list(FRAMES)
    assert images(tmp_path / "film") == alone
    assert seen[-1] == ("frames", 1.0, "3 of 3")
    assert sorted(path.name for path in (tmp_path / "film").iterdir()) == ["0001", "0002", "0003"]
    again = render_on(Cluster(scheduler.scheduler_address), animation(tmp_path, FRAMES), Tools("/must/not/run"))
    assert states(again) == [KEPT] * 3


def slow(path: Path) -> str:
    """A played Blender that says by a file of its process's name that it is at work, and takes its time."""
    inner = played_blender(path.with_name("inner"))
    path.write_text(f"#!{sys.executable}\nimport os, sys, time\nif '--version' not in sys.argv:\n"
                    f"    open({str(path)!r} + f'.{{os.getppid()}}.pid', 'w').close()\n    time.sleep(1.5)\n"
                    f"os.execv({inner!r}, sys.argv)\n")
    path.chmod(0o755)
    return str(path)


def wait_for_work(folder: Path) -> None:
    """Wait until a worker has begun a frame."""
    while not list(folder.glob("blender.*.pid")):
        time.sleep(0.02)


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
    results = render_on(Cluster(scheduler.scheduler_address), animation(tmp_path, FRAMES),
                        Tools(slow(tmp_path / "blender"), chunk=1))
    thread.join(5)
    assert killed and states(results) == [MADE] * 3 and images(tmp_path / "film") == alone
    assert len(list(tmp_path.glob("blender.*.pid"))) >= 2, "another worker has taken over"


@pytest.fixture
def processes(tmp_path):
    """A scheduler, one worker without a nanny, and the scheduler's address."""
    known = tmp_path / "scheduler.json"
    started = [_start(tmp_path, "scheduler", "--port", "0", "--no-dashboard", "--host", "127.0.0.1",
                      "--scheduler-file", str(known))]
    while not (known.exists() and known.read_text().endswith("}")):
        time.sleep(0.1)
    address = json.loads(known.read_text())["address"]
    started.append(_start(tmp_path, "worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard"))
    with distributed.Client(address, set_as_default=False) as client:
        client.wait_for_workers(1)
    yield *started, address
    for process in started:
        process.kill()
        process.wait()


def _start(folder: Path, kind: str, *words: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *words]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "TMPDIR": str(folder)}
    return subprocess.Popen(command, cwd=folder, stderr=subprocess.DEVNULL, env=environment)


@pytest.mark.parametrize(("kind", "sentence"), [
    ("worker", r"no worker of tcp://\S+ is left: start some by `dask worker ADDRESS`, and run the same command again"),
    ("scheduler", r"the scheduler tcp://\S+ has ended: start it and its workers, and run the same command again")])
@pytest.mark.skipif(sys.platform == "win32", reason="kills")
def test_the_end_of_all_workers_or_of_the_scheduler_is_told(processes, alone, tmp_path, monkeypatch, capfd, kind,
                                                                 sentence):
    """And the next run, on other workers, clears what the dead one left."""
    monkeypatch.setattr(cluster, "SECONDS_WITHOUT_WORKERS", 1)
    scheduler, worker, address = processes
    ended = worker if kind == "worker" else scheduler

    def kill() -> None:
        wait_for_work(tmp_path)
        ended.kill()
    thread = threading.Thread(target=kill, daemon=True)
    thread.start()
    started = time.monotonic()
    film, tools = animation(tmp_path, FRAMES), Tools(slow(tmp_path / "blender"), chunk=1)
    with pytest.raises(LfsrError, match=sentence):
        render_on(Cluster(address), film, tools)
    assert time.monotonic() - started < 30
    assert "Traceback" not in capfd.readouterr().err
    worker.kill()
    worker.wait()
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as other:
        render_on(Cluster(other.scheduler_address), film, tools)
    assert images(tmp_path / "film") == alone
    assert sorted(path.name for path in (tmp_path / "film").iterdir()) == ["0001", "0002", "0003"]


@pytest.mark.skipif(sys.platform == "win32", reason="kills")
def test_a_worker_that_is_killed_while_it_starts_is_told(tmp_path, capfd):
    before = psutil.Process().children()

    def kill() -> None:
        found: list[psutil.Process] = []
        while not found:
            new = set(psutil.Process().children()).difference(before)
            found = [child for child in new if "spawn_main" in " ".join(child.cmdline())]
        found[0].kill()
    thread = threading.Thread(target=kill, daemon=True)
    thread.start()
    with pytest.raises(LfsrError, match="2 workers could not be started .*: check that this machine has enough memory"):
        render_on(Cluster(workers=2), animation(tmp_path, FRAMES), Tools(slow(tmp_path / "blender"), chunk=1))
    thread.join(5)
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
def test_a_worker_that_does_not_see_the_folder(scheduler, tmp_path):
    """What lies behind a descriptor of this process nobody else sees under that name."""
    shown = os.open(tmp_path, os.O_RDONLY)
    try:
        with pytest.raises(LfsrError, match=r"the worker tcp://\S+ does not see the folder /proc/\S+/film: make"):
            render_on(Cluster(scheduler.scheduler_address), animation(Path(f"/proc/self/fd/{shown}"), FRAMES),
                      Tools("/must/not/run"))
    finally:
        os.close(shown)
    assert list((tmp_path / "film").iterdir()) == [], "no mark is left"


def test_blenders_own_sentence_arrives(scheduler, tmp_path):
    with pytest.raises(LfsrError, match="'/must/not/run' was not found"):
        render_on(Cluster(scheduler.scheduler_address), animation(tmp_path, (1,)), Tools("/must/not/run"))


def test_the_command_on_workers_of_this_machine(tmp_path, alone):
    blender = played_blender(tmp_path / "blender")
    (tmp_path / "scene.glb").write_text("a scene")
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    command = [sys.executable, "-m", "lfsr_core.cli", "render", str(tmp_path / "scene.glb"), "-o", "film", "--frames",
               "1-3", "--display", "mini", "--scale", "2", "--spp", "16", "--seed", "5", "--method", "bicubic",
               "--blender", blender, "--workers", "2"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False,
                          env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
                                            "TMPDIR": str(temporary)})
    assert done.returncode == 0, done.stderr
    assert "3 frames: 3 made, 0 kept, 0 failed" in done.stdout and "Traceback" not in done.stderr
    assert images(tmp_path / "film") == alone
    assert not list((tmp_path / "film").glob(f"{PLACE_FILE}*")) and not list(temporary.iterdir())


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """The job of a reference, and the folder that one process made of it."""
    folder = tmp_path_factory.mktemp("reference")
    (folder / "scene.glb").write_text("a scene")
    job = dataclasses.replace(JOB, kind="reference", scale=1, spp=22, scene=str(folder / "scene.glb"),
                              output=str(folder / "alone"))
    run_job(job, find_blender(played_blender(folder / "blender")))
    return job, folder


def halves(folder):
    return [read_layers(folder / name)["color"] for name in REFERENCE_FILES]


def test_a_reference_by_rows_is_that_of_one_process(scheduler, reference):
    job, folder = reference
    seen = []
    reference_on(Cluster(scheduler.scheduler_address), dataclasses.replace(job, output=str(folder / "rows")),
                 Split(ROWS, 3), str(folder / "blender"), lambda *state: seen.append(state))
    for found, whole in zip(halves(folder / "rows"), halves(folder / "alone"), strict=True):
        # As references are stored, which the played Blender does not care for.
        np.testing.assert_array_equal(found, whole.astype(np.float16))
    assert read_part(folder / "rows").rows is None and not list(folder.glob(".rows*"))
    assert [message for stage, _, message in seen if stage == "reference"] == [f"{k} of 3 parts" for k in (1, 2, 3)]


def test_a_reference_by_samples_has_all_of_them_and_continues_from_parts_that_are_there(scheduler, reference):
    job, folder = reference
    job = dataclasses.replace(job, output=str(folder / "samples"))
    wanted = part_jobs(job, SAMPLES, 3)
    assert [part.sampling.samples for part in wanted] == [6, 8, 8] and len({part.seed for part in wanted}) == 3
    for part in wanted:
        run_job(part, find_blender(str(folder / "blender")))
    made = [halves(Path(part.output)) for part in wanted]
    reference_on(Cluster(scheduler.scheduler_address), job, Split(SAMPLES, 3), "/must/not/run", lambda *_: None)
    assert read_part(folder / "samples").samples == 22
    for half, found in enumerate(halves(folder / "samples")):
        expected = sum(part.sampling.samples * images[half] for part, images in zip(wanted, made, strict=True)) / 22
        np.testing.assert_allclose(found, expected, atol=2e-3)
    pairs = zip(halves(folder / "samples"), halves(folder / "alone"), strict=True)
    assert max(np.var(image - true) for image, true in pairs) < np.var(made[0][0] - made[1][0]), "less noise"


@given(st.integers(2, 400), st.integers(1, 12), st.sampled_from([ROWS, SAMPLES]))
def test_parts_are_the_whole(reference, spp, count, by):
    job = reference[0].sampled(samples=spp)
    count = min(count, spp // 2) if by == SAMPLES else count
    jobs = part_jobs(job, by, count)
    assert len({part.output for part in jobs}) == count and all(part.sampling.samples >= 2 for part in jobs)
    if by == ROWS:
        check_cover((part.rows for part in jobs), job.display.lenses[1])
    else:
        assert sum(part.sampling.samples for part in jobs) == spp and len({part.seed for part in jobs}) == count


@pytest.mark.parametrize(("options", "sentence"), [
    (["--workers", "2", "--rows", "1/2"], "--rows 1/2 renders a part already"),
    (["--parts", "2"], "--parts was given without --workers"),
    (["--workers", "1", "--split", "samples", "--parts", "9", "--spp", "4"], "by samples they must be 1 to 2")])
def test_bad_parts(tmp_path, capsys, options, sentence):
    (tmp_path / "scene.glb").touch()
    assert sentence in fails(["reference", str(tmp_path / "scene.glb"), "-o", str(tmp_path / "r"), "--display", "mini",
                              *options], capsys)


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
