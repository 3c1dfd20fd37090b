"""A shot on several workers of Dask distributed, which hands out the work and does a dead worker's again.

A task is a few frames that follow each other, rendered and finished as ``engine.render_shot`` does it, or one part of a
frame. Nothing is sent but jobs and results: scene and folders lie where every worker sees them.
"""

from __future__ import annotations

import contextlib
import dataclasses
import logging
import secrets
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lfsr_core.errors import LfsrError
from lfsr_core.files import system_errors
from lfsr_core.progress import Progress
from lfsr_core.sequence.engine import Result, Tools, render_shot
from lfsr_core.sequence.shot import DONE, Shot, state

if TYPE_CHECKING:
    from distributed import Client, Future

RESOURCE = "LFSR"  # of a worker: how many tasks it may have at once
RETRIES = 2  # of a task whose worker says an error that another worker might not have
DEATHS = 3  # workers that may die over one task before it is given up
SECONDS_TO_CONNECT = 20
PLACE_FILE = ".lfsr-place-"


@dataclasses.dataclass(frozen=True)
class Cluster:
    """Who does the work."""

    address: str | None = None  # of a scheduler, None for workers on this machine
    workers: int = 1  # on this machine

    @contextlib.contextmanager
    def client(self) -> Iterator[Client]:
        """Connected while the block runs; LfsrError where that fails."""
        try:
            import dask
            from distributed import LocalCluster
        except ImportError:
            raise LfsrError("several workers need the package distributed: install the extra 'farm', as by "
                            "pip install 'lfsr[farm]'") from None
        with dask.config.set({"distributed.scheduler.allowed-failures": DEATHS}), contextlib.ExitStack() as stack:
            where = self.address or stack.enter_context(LocalCluster(
                n_workers=self.workers, threads_per_worker=1, resources={RESOURCE: 1}, dashboard_address=None,
                silence_logs=logging.CRITICAL))
            yield stack.enter_context(self._connected(where))

    def _connected(self, where: object) -> Client:
        from distributed import Client

        try:
            return Client(where, timeout=SECONDS_TO_CONNECT, set_as_default=False)
        except (OSError, ValueError) as error:
            raise LfsrError(f"{self.address} cannot be reached as a Dask scheduler ({error}): start one by "
                            "`dask scheduler` and give its address, as tcp://host:8786") from None


def render_on(cluster: Cluster, shot: Shot, tools: Tools) -> list[Result]:
    """As ``engine.render_shot``, on a cluster.

    Raises
    ------
    LfsrError : where a worker does not see the scene or the folder, or with a task's own sentence
    """
    with cluster.client() as client:
        return _render(client, shot, tools)


def _render(client: Client, shot: Shot, tools: Tools) -> list[Result]:
    output = Path(shot.jobs[0].output).parent
    quiet = Tools(tools.blender, chunk=tools.chunk, overwrite=tools.overwrite)
    with _place(output) as place:
        workers = client.scheduler_info(n_workers=-1)["workers"]
        if not workers:
            raise LfsrError("the scheduler has no workers: start some by `dask worker ADDRESS`")
        _check_workers(client, place, shot.jobs[0].scene)
        uses = all(RESOURCE in worker.get("resources", {}) for worker in workers.values())
        chunks = list(_chunks(shot, tools, len(workers)))
        tasks = [client.submit(_work, chunk, quiet, str(place), key=f"lfsr-{chunk.jobs[0].frame}-{place.name[-8:]}",
                               retries=RETRIES, resources={RESOURCE: 1} if uses else None, pure=False)
                 for chunk in chunks]
        return _gathered(tasks, shot, tools.progress, client.loop)


def _chunks(shot: Shot, tools: Tools, workers: int) -> Iterator[Shot]:
    """Neighbouring frames together, as many as one Blender takes, and few enough that all workers have some.

    Frames that are done go last and together, since they cost nothing.
    """
    done = [] if tools.overwrite else [job for job in shot.jobs if state(shot, job) == DONE]
    waiting = [job for job in shot.jobs if job not in done]
    size = max(1, min(tools.chunk, -(-len(waiting) // (2 * workers))))
    for first in range(0, len(waiting), size):
        yield dataclasses.replace(shot, jobs=tuple(waiting[first:first + size]))
    if done:
        yield dataclasses.replace(shot, jobs=tuple(done))


def _work(shot: Shot, tools: Tools, place: str) -> list[Result]:
    """The task, on a worker."""
    sentence = _blind(place, shot.jobs[0].scene)
    if sentence:
        raise LfsrError(f"a worker {sentence}")
    return render_shot(shot, tools)


def _gathered(tasks: Sequence[Future], shot: Shot, progress: Progress, loop: Any) -> list[Result]:
    from distributed import as_completed

    results: dict[str, Result] = {}
    try:
        for task in as_completed(tasks, loop=loop):
            results |= {result.folder: result for result in _result(task)}
            progress("frames", len(results) / len(shot.jobs), f"{len(results)} of {len(shot.jobs)}")
    finally:
        for task in tasks:
            task.cancel()
    return [results[job.output] for job in shot.jobs]


def _result(task: Future) -> list[Result]:
    from distributed import KilledWorker

    try:
        return task.result()
    except KilledWorker:
        raise LfsrError(f"{DEATHS + 1} workers died over the same frames, the last over {task.key}: look whether their "
                        "machines have enough memory, and start again, what is done is kept") from None


@contextlib.contextmanager
def _place(output: Path) -> Iterator[Path]:
    """A file in ``output`` while the block runs, by which workers know the folder."""
    place = output / f"{PLACE_FILE}{secrets.token_hex(4)}"
    with system_errors(output):
        output.mkdir(parents=True, exist_ok=True)
        place.touch()
    try:
        yield place
    finally:
        place.unlink(missing_ok=True)


def _check_workers(client: Client, place: Path, scene: str) -> None:
    """LfsrError where a worker does not see what this machine sees."""
    answers: dict[str, Any] = client.run(_blind, str(place), scene, on_error="return")
    for worker, sentence in answers.items():
        if sentence:
            raise LfsrError(f"the worker {worker} {sentence}")


def _blind(place: str, scene: str) -> str:
    """What a worker cannot see, empty where it sees everything; runs there."""
    if not Path(place).exists():
        return f"does not see the folder {Path(place).parent}: share it with its machine under the same path"
    if not Path(scene).is_file():
        return f"does not see the scene {scene}: share it with its machine under the same path"
    return ""
