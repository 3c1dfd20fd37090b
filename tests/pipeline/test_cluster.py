"""An animation on real worker processes: the same images, whoever dies, and a sentence where a worker sees nothing."""

import contextlib
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

from lfsr_core.base.messages import silent
from lfsr_core.cli import main
from lfsr_core.frames.frame import REFERENCE_FILES, read_part
from lfsr_core.images.image_files import read_layers
from lfsr_core.optics.rays import check_cover
from lfsr_core.pipeline import cluster
from lfsr_core.pipeline.cluster import RESOURCE, make_on, reference_on, reference_parts
from lfsr_core.pipeline.make import KEPT, MADE, make
from tests.support.animations import FINISH, film, film_request, images, states
from tests.support.played_blender import changed_blender, played_blender
from tests.support.processes import wait_for
from tests.support.synthetic import fails
from tests.support.told import refuses

distributed = pytest.importorskip("distributed") if not os.environ.get("CI") else __import__("distributed")
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
    film(folder, FRAMES, blender=played_blender(folder / "blender"))
    return images(folder / "film")


def film_on(address, folder, blender="/must/not/run", frames=FRAMES, tell=silent):
    return make_on(address, film_request(folder), FINISH, frames, blender, False, tell)


def test_the_commands_workers_make_the_pictures_of_one_process(scheduler, tmp_path, alone, monkeypatch, capsys):
    (tmp_path / "scene.glb").write_text("a scene")
    monkeypatch.chdir(tmp_path)
    assert main(["render", "scene.glb", "-o", "film", "--frames", "1-3", "--display", "mini", "--scale", "2", "--spp",
                 "16", "--seed", "5", "--method", "bicubic", "--blender", played_blender(tmp_path / "blender"),
                 "--cluster", scheduler.scheduler_address]) == 0
    assert "3 frames: 3 made, 0 kept, 0 failed" in capsys.readouterr().out and images(tmp_path / "film") == alone
    assert sorted(path.name for path in (tmp_path / "film").iterdir()) == ["0001", "0002", "0003"]
    told = []
    assert states(film_on(scheduler.scheduler_address, tmp_path, tell=told.append)) == [KEPT] * 3
    assert told[-1].fraction == 1


def slow(path: Path) -> str:
    """A played Blender whose first render never ends; a file tells the processes of its worker and of it."""
    return changed_blender(path, """
try:
    os.open(here + '.first', os.O_CREAT | os.O_EXCL)
    Path(here + '.pids').write_text(f'{os.getppid()} {os.getpid()} end')
    time.sleep(600)
except FileExistsError:
    pass
""")


def of_first(blender: str) -> tuple[int, int]:
    """Processes of the worker that began first and of its Blender."""
    pids = Path(f"{blender}.pids")
    wait_for(lambda: pids.exists() and pids.read_text().endswith("end"))
    return tuple(map(int, pids.read_text().split()[:2]))


@pytest.mark.skipif(sys.platform == "win32", reason="kills")
def test_a_dead_workers_frames_are_made_by_others(scheduler, tmp_path, alone):
    blender = slow(tmp_path / "blender")

    def kill_first_worker() -> None:
        for pid in of_first(blender):  # Blender ends with its input
            os.kill(pid, signal.SIGKILL)
    thread = threading.Thread(target=kill_first_worker, daemon=True)
    thread.start()
    made = film_on(scheduler.scheduler_address, tmp_path, blender)
    thread.join(5)
    assert states(made) == [MADE] * 3 and images(tmp_path / "film") == alone


@pytest.fixture
def processes(tmp_path):
    """A scheduler, one worker without a nanny, and the scheduler's address."""
    file = tmp_path / "scheduler.json"
    started = [_start(tmp_path, "scheduler", "--port", "0", "--no-dashboard", "--host", "127.0.0.1",
                      "--scheduler-file", str(file))]
    while not (file.exists() and file.read_text().endswith("}")):
        time.sleep(0.1)
    address = json.loads(file.read_text())["address"]
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
    ("worker", "tcp://.* has no worker"), ("scheduler", "the scheduler tcp://.* has ended")])
@pytest.mark.skipif(sys.platform == "win32", reason="kills")
def test_the_end_of_all_workers_or_of_the_scheduler_is_told(scheduler, processes, alone, tmp_path, monkeypatch, capfd,
                                                            kind, sentence):
    """And the next run, on other workers, clears what the dead one left."""
    monkeypatch.setattr(cluster, "SECONDS_WITHOUT_WORKERS", 1)
    its_scheduler, worker, address = processes
    ended, blender = worker if kind == "worker" else its_scheduler, slow(tmp_path / "blender")

    def kill() -> None:
        of_first(blender)
        ended.kill()
    threading.Thread(target=kill, daemon=True).start()
    started = time.monotonic()
    refuses(sentence, film_on, address, tmp_path, blender)
    assert time.monotonic() - started < 30 and "Traceback" not in capfd.readouterr().err
    worker.kill()
    worker.wait()
    with contextlib.suppress(ProcessLookupError):  # the worker may have ended it
        os.kill(of_first(blender)[1], signal.SIGKILL)  # as Blender ends with its input
    film_on(scheduler.scheduler_address, tmp_path, blender)
    assert images(tmp_path / "film") == alone
    assert sorted(path.name for path in (tmp_path / "film").iterdir()) == ["0001", "0002", "0003"]


@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
def test_a_worker_that_does_not_see_the_folder_and_blenders_own_sentence(scheduler, tmp_path):
    """What lies behind a descriptor of this process nobody else sees under that name."""
    shown = os.open(tmp_path, os.O_RDONLY)
    try:
        refuses("does not see the folder /proc/", film_on, scheduler.scheduler_address, Path(f"/proc/self/fd/{shown}"))
    finally:
        os.close(shown)
    assert list((tmp_path / "film").iterdir()) == [], "no mark is left"
    refuses("'/must/not/run' was not found", film_on, scheduler.scheduler_address, tmp_path, frames=(1,))


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """The job of a reference, and the folder that one process made of it."""
    folder = tmp_path_factory.mktemp("reference")
    (folder / "scene.glb").write_text("a scene")
    request = film_request(folder, kind="reference", scale=1, samples=22, output=str(folder / "alone"))
    make(request, blender=played_blender(folder / "blender"))
    return request, folder


def halves(folder):
    return [read_layers(folder / name)["color"] for name in REFERENCE_FILES]


def test_a_reference_by_rows_is_that_of_one_process(scheduler, reference):
    request, folder = reference
    told = []
    reference_on(scheduler.scheduler_address, dataclasses.replace(request, output=str(folder / "rows")),
                 str(folder / "blender"), told.append)
    for merged, whole in zip(halves(folder / "rows"), halves(folder / "alone"), strict=True):
        # As references are stored, which the played Blender does not care for.
        np.testing.assert_array_equal(merged, whole.astype(np.float16))
    assert read_part(folder / "rows").rows is None and not list(folder.glob(".rows*"))
    assert [message.fraction for message in told if message.stage == "reference"] == [0.25, 0.5, 0.75, 1]


def test_a_reference_by_samples_continues_from_parts_that_are_there(scheduler, reference):
    request, folder = reference
    lenses = tuple((row, column) for row in range(3) for column in range(3))
    request = dataclasses.replace(request, output=str(folder / "samples"), lens_list=lenses)
    parts = reference_parts(request, 4, ".samples-workers-")
    for part in parts:
        make(part, blender=str(folder / "blender"))
    made = [halves(Path(part.output)) for part in parts]
    reference_on(scheduler.scheduler_address, request, "/must/not/run", silent)
    assert read_part(folder / "samples").samples == 22
    for half, merged in enumerate(halves(folder / "samples")):
        expected = sum(part.sampling.samples * images[half] for part, images in zip(parts, made, strict=True)) / 22
        np.testing.assert_allclose(merged, expected, atol=2e-3)


@given(st.integers(2, 400), st.integers(1, 12), st.booleans())
def test_parts_are_the_whole(reference, samples, most, is_listed):
    request = dataclasses.replace(reference[0].sampled(samples=samples), lens_list=((0, 0),) if is_listed else None)
    parts = reference_parts(request, most, ".x-")
    assert len({part.output for part in parts}) == len(parts) <= most
    if is_listed:
        assert sum(part.sampling.samples for part in parts) == samples and len({p.seed for p in parts}) == len(parts)
        assert all(part.sampling.samples >= 2 for part in parts)
    else:
        check_cover((part.rows for part in parts), request.display.lenses[1])


@pytest.mark.parametrize(("verb", "options", "sentence"), [
    ("reference", ["--cluster", "tcp://x", "--rows", "1/2"], "--rows 1/2 and --cluster"),
    ("render", ["--cluster", "tcp://x"], "--cluster was given without --frames"),
    ("render", ["--overwrite"], "--overwrite was given without"),
    ("render", ["--frames", "1", "--cluster", "nonsense://x"], "nonsense://x cannot be reached as a Dask scheduler")])
def test_bad_arguments(tmp_path, capsys, verb, options, sentence):
    (tmp_path / "scene.glb").touch()
    assert sentence in fails([verb, str(tmp_path / "scene.glb"), "-o", str(tmp_path / "out"), "--display", "mini",
                              *options], capsys)


def test_main_is_the_same_without_dask(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "distributed", None)
    (tmp_path / "scene.glb").touch()
    assert "install the extra 'farm'" in fails(["render", str(tmp_path / "scene.glb"), "-o", str(tmp_path / "film"),
                                                "--display", "mini", "--frames", "1", "--cluster", "tcp://x"], capsys)
