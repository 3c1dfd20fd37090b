"""Tasks on several workers of Dask distributed, which hands them out and repeats those of a worker that dies.

Only jobs and results are sent: the scene and the folders are where every worker sees them.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import dataclasses
import logging
import queue
import secrets
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import system_errors

RESOURCE = "LFSR"  # of a worker: how many tasks it may have at once
RETRIES = 2  # of a task that fails on one worker and may succeed on another
DEATHS = 3  # workers that may die over one task before it is given up
SECONDS_TO_CONNECT = 20
SECONDS_TO_LOOK = 2.0  # between two looks at the workers while no task ends
SECONDS_WITHOUT_WORKERS = 20.0  # after which no new ones are awaited
AGAIN = "and run the same command again to continue"
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
        with _silence(), contextlib.ExitStack() as stack:
            folder = stack.enter_context(tempfile.TemporaryDirectory("", "lfsr-workers-", ignore_cleanup_errors=True))
            stack.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": DEATHS,
                                                 "temporary-directory": folder}))
            where = self.address or stack.enter_context(self._local(package))
            try:
                client = package.Client(where, timeout=SECONDS_TO_CONNECT, set_as_default=False)
            except (OSError, ValueError) as error:
                raise LfsrError(f"{self.address} cannot be reached as a Dask scheduler ({error}): start one by "
                                "`dask scheduler` and give its address, as tcp://host:8786") from None
            yield stack.enter_context(client)

    def _local(self, package: Any) -> Any:
        """Start a scheduler and workers on this machine."""
        try:
            return package.LocalCluster(n_workers=self.workers, threads_per_worker=1, resources={RESOURCE: 1},
                                        dashboard_address=None, silence_logs=logging.CRITICAL)
        except (OSError, RuntimeError) as error:
            raise LfsrError(f"{self.workers} workers could not be started ({error}): check that this machine has "
                            f"enough memory for them, {AGAIN}") from None


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Print nothing of distributed's log inside the block: it has tracebacks of what we tell in a sentence."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(before)


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
        answers: dict[str, Any] = client.run(_blind, str(place), scene, on_error="return")
        for worker, sentence in answers.items():
            if sentence and not isinstance(sentence, OSError):  # that one has died, and its tasks go to others
                raise LfsrError(f"the worker {worker} {sentence}")
        uses = all(RESOURCE in worker.get("resources", {}) for worker in workers.values())
        submitted = [client.submit(_work, task.function, task.arguments, str(place), scene,
                                   key=f"lfsr-{task.name}-{place.name[-8:]}", retries=RETRIES,
                                   resources={RESOURCE: 1} if uses else None, pure=False)
                     for task in tasks(len(workers))]
        _gather(client, submitted, took)


def _work(function: Callable[..., Any], arguments: tuple[Any, ...], place: str, scene: str) -> Any:
    """Do a task, on a worker."""
    sentence = _blind(place, scene)
    if sentence:
        raise LfsrError(f"a worker {sentence}")
    return function(*arguments)


def _gather(client: Any, submitted: list[Any], took: Callable[[Any], None]) -> None:
    """Call ``took`` with each result; LfsrError where workers die over a task, or none or no scheduler is left."""
    import distributed

    package: Any = distributed
    ended = queue.SimpleQueue[Any]()
    for task in submitted:
        task.add_done_callback(ended.put)
    try:
        for _ in submitted:
            task = _next(client, ended)
            try:
                took(task.result())
            except package.KilledWorker:
                raise LfsrError(f"{DEATHS + 1} workers died over the same work, the last over {task.key}: check that "
                                f"their machines have enough memory, {AGAIN}") from None
            except concurrent.futures.CancelledError:
                raise LfsrError(f"the scheduler {client.scheduler.address} has ended: start it and its workers, {AGAIN}"
                                ) from None
    finally:
        with contextlib.suppress(concurrent.futures.CancelledError, OSError):
            client.cancel(submitted)


def _next(client: Any, ended: queue.SimpleQueue[Any]) -> Any:
    """Wait for the next task that ends."""
    seen = time.monotonic()
    while True:
        with contextlib.suppress(queue.Empty):
            return ended.get(timeout=min(SECONDS_TO_LOOK, SECONDS_WITHOUT_WORKERS))
        with contextlib.suppress(OSError):  # the scheduler is away: then all tasks are cancelled
            if client.scheduler_info(n_workers=-1)["workers"]:
                seen = time.monotonic()
        if time.monotonic() - seen > SECONDS_WITHOUT_WORKERS:
            raise LfsrError(f"no worker of {client.scheduler.address} is left: start some by `dask worker ADDRESS`, "
                            f"{AGAIN}")


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
