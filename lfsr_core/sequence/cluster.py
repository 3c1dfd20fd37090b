"""Work on several workers of Dask distributed, which hands it out and does a dead worker's again.

Nothing is sent but jobs and results: scene and folders lie where every worker sees them.
"""

from __future__ import annotations

import contextlib
import dataclasses
import logging
import secrets
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lfsr_core.errors import LfsrError
from lfsr_core.files import system_errors

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


@dataclasses.dataclass(frozen=True)
class Piece:
    """What one task calls, on a worker; safe to be done again."""

    name: str  # no other piece's
    function: Callable[..., Any]
    arguments: tuple[Any, ...]


@dataclasses.dataclass(frozen=True)
class Site:
    """What every worker must see under the same path."""

    output: Path  # the folder that they write into
    scene: str


def work_through(cluster: Cluster, site: Site, pieces: Callable[[int], Iterable[Piece]],
                 took: Callable[[Any], None]) -> None:
    """Let the workers of a cluster do some work.

    Parameters
    ----------
    cluster : whose workers
    site : what they must see
    pieces : called with the number of workers; the work
    took : called with the result of each piece as it comes

    Raises
    ------
    LfsrError : where a worker does not see the scene or the folder, or with a piece's own sentence
    """
    with cluster.client() as client, _place(site.output) as place:
        workers = client.scheduler_info(n_workers=-1)["workers"]
        if not workers:
            raise LfsrError("the scheduler has no workers: start some by `dask worker ADDRESS`")
        _check_workers(client, place, site.scene)
        uses = all(RESOURCE in worker.get("resources", {}) for worker in workers.values())
        tasks = [client.submit(_work, piece.function, piece.arguments, str(place), site.scene,
                               key=f"lfsr-{piece.name}-{place.name[-8:]}", retries=RETRIES,
                               resources={RESOURCE: 1} if uses else None, pure=False)
                 for piece in pieces(len(workers))]
        _gather(tasks, took, client.loop)


def _work(function: Callable[..., Any], arguments: tuple[Any, ...], place: str, scene: str) -> Any:
    """The task, on a worker."""
    sentence = _blind(place, scene)
    if sentence:
        raise LfsrError(f"a worker {sentence}")
    return function(*arguments)


def _gather(tasks: Sequence[Future], took: Callable[[Any], None], loop: Any) -> None:
    from distributed import as_completed

    try:
        for task in as_completed(tasks, loop=loop):
            took(_result(task))
    finally:
        for task in tasks:
            task.cancel()


def _result(task: Future) -> Any:
    from distributed import KilledWorker

    try:
        return task.result()
    except KilledWorker:
        raise LfsrError(f"{DEATHS + 1} workers died over the same work, the last over {task.key}: look whether their "
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
