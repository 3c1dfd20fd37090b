"""Tasks on several workers of Dask distributed, which hands them out and repeats those of a worker that dies.

Only jobs and results are sent: the scene and the folders are where every worker sees them.
"""

from __future__ import annotations

import contextlib
import dataclasses
import logging
import secrets
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from lfsr_core.errors import LfsrError
from lfsr_core.files import system_errors

RESOURCE = "LFSR"  # of a worker: how many tasks it may have at once
RETRIES = 2  # of a task that fails on one worker and may succeed on another
DEATHS = 3  # workers that may die over one task before it is given up
SECONDS_TO_CONNECT = 20
PLACE_FILE = ".lfsr-place-"


class Task(NamedTuple):
    """A function call on a worker, which may be repeated."""

    name: str  # unique
    function: Callable[..., Any]
    arguments: tuple[Any, ...]


@dataclasses.dataclass(frozen=True)
class Cluster:
    """The workers."""

    address: str | None = None  # of a scheduler, None for workers on this machine
    workers: int = 1  # on this machine

    @contextlib.contextmanager
    def client(self) -> Iterator[Any]:
        """Yield a connected ``distributed.Client``; LfsrError where that fails."""
        try:
            import dask
            import distributed
        except ImportError:
            raise LfsrError("several workers need the package distributed: install the extra 'farm', as by "
                            "pip install 'lfsr[farm]'") from None
        package: Any = distributed  # has no types
        with dask.config.set({"distributed.scheduler.allowed-failures": DEATHS}), contextlib.ExitStack() as stack:
            where = self.address or stack.enter_context(package.LocalCluster(
                n_workers=self.workers, threads_per_worker=1, resources={RESOURCE: 1}, dashboard_address=None,
                silence_logs=logging.CRITICAL))
            try:
                client = package.Client(where, timeout=SECONDS_TO_CONNECT, set_as_default=False)
            except (OSError, ValueError) as error:
                raise LfsrError(f"{self.address} cannot be reached as a Dask scheduler ({error}): start one by "
                                "`dask scheduler` and give its address, as tcp://host:8786") from None
            yield stack.enter_context(client)


def work_through(cluster: Cluster, output: Path, scene: str, tasks: Callable[[int], Iterable[Task]],
                 took: Callable[[Any], None]) -> None:
    """Have the workers of a cluster do ``tasks``, called with their number; ``took`` is called with each result.

    Every worker must see the folder ``output`` and the file ``scene`` under the same path. LfsrError where one does
    not, or with a task's own sentence.
    """
    with cluster.client() as client, _place(output) as place:
        workers = client.scheduler_info(n_workers=-1)["workers"]
        if not workers:
            raise LfsrError("the scheduler has no workers: start some by `dask worker ADDRESS`")
        answers: dict[str, str] = client.run(_blind, str(place), scene, on_error="return")
        for worker, sentence in answers.items():
            if sentence:
                raise LfsrError(f"the worker {worker} {sentence}")
        uses = all(RESOURCE in worker.get("resources", {}) for worker in workers.values())
        submitted = [client.submit(_work, task.function, task.arguments, str(place), scene,
                                   key=f"lfsr-{task.name}-{place.name[-8:]}", retries=RETRIES,
                                   resources={RESOURCE: 1} if uses else None, pure=False)
                     for task in tasks(len(workers))]
        _gather(submitted, took, client.loop)


def _work(function: Callable[..., Any], arguments: tuple[Any, ...], place: str, scene: str) -> Any:
    """Do a task, on a worker."""
    sentence = _blind(place, scene)
    if sentence:
        raise LfsrError(f"a worker {sentence}")
    return function(*arguments)


def _gather(submitted: list[Any], took: Callable[[Any], None], loop: Any) -> None:
    import distributed

    package: Any = distributed
    try:
        for task in package.as_completed(submitted, loop=loop):
            try:
                took(task.result())
            except distributed.KilledWorker:
                raise LfsrError(f"{DEATHS + 1} workers died over the same work, the last over {task.key}: check that "
                                "their machines have enough memory, and run the same command again to continue"
                                ) from None
    finally:
        for task in submitted:
            task.cancel()


@contextlib.contextmanager
def _place(output: Path) -> Iterator[Path]:
    """Put a file into ``output`` while the block runs, by which workers recognise the folder."""
    place = output / f"{PLACE_FILE}{secrets.token_hex(4)}"
    with system_errors(output):
        output.mkdir(parents=True, exist_ok=True)
        place.touch()
    try:
        yield place
    finally:
        place.unlink(missing_ok=True)


def _blind(place: str, scene: str) -> str:
    """Return what a worker cannot see, empty where it sees everything; runs on the worker."""
    if not Path(place).exists():
        return f"does not see the folder {Path(place).parent}: make it visible on its machine under the same path"
    if not Path(scene).is_file():
        return f"does not see the scene {scene}: make it visible on its machine under the same path"
    return ""
