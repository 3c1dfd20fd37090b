"""Renders on a Dask cluster: the workers of a scheduler render frames of an animation, or parts of a reference.

Only requests and results are sent: every worker must see the scene and the folders under the same paths. Dask hands
tasks out and repeats those of a worker that dies.
"""

import concurrent.futures
import contextlib
import dataclasses
import functools
import logging
import secrets
import shutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from lfsr_core.base.messages import LfsrError, Progress, Tell
from lfsr_core.base.system import system_errors
from lfsr_core.frames.folder import FrameFolder, digest, request_facts, scene_stamp
from lfsr_core.frames.frame import Finish, Request
from lfsr_core.optics.rays import parse_rows
from lfsr_core.pipeline.make import Made, make, requests_of
from lfsr_core.pipeline.merge import merge

RESOURCE = "LFSR"  # of a worker: how many tasks it may have at once
RETRIES = 2  # of a task that fails on one worker and may succeed on another
SECONDS_TO_CONNECT, SECONDS_WITHOUT_WORKERS = 20, 20.0
MOST_CHUNK, PARTS_PER_WORKER = 16, 2  # frames that one Blender renders; several parts, so that a fast worker does more
AGAIN = "and run the same command again to continue"
Task = tuple[str, Callable[[], list[Made]]]  # a unique name, and a call that may be repeated


def make_on(address: str, request: Request, finish: Finish, frames: Sequence[int], blender: str | None,
            overwrite: bool, tell: Tell) -> list[Made]:
    """Make an animation as ``make`` does, on the workers of a scheduler at ``address``; errors as of ``results_of``."""
    if finish.temporal_averaging:
        raise LfsrError("--temporal-averaging was given, but each worker of a cluster knows its own frames only: leave "
                        "out --cluster, or --temporal-averaging")
    requests, made = requests_of(request, finish, frames, overwrite), dict[str, Made]()
    of_all = dataclasses.replace(request, sampling=requests[0].sampling)

    def tasks(workers: int) -> Iterator[Task]:
        size = max(1, min(MOST_CHUNK, -(-len(frames) // (2 * workers))))
        for first in range(0, len(frames), size):
            yield str(frames[first]), functools.partial(make, of_all, finish, frames[first:first + size],
                                                        blender=blender, overwrite=overwrite)

    for results in results_of(tasks, address, Path(request.output), request.scene):
        made.update((result.folder, result) for result in results)
        tell(Progress("frames", len(made) / len(frames), f"{len(made)} of {len(frames)}"))
    return [made[asked.output] for asked in requests]


def reference_on(address: str, request: Request, blender: str | None, tell: Tell) -> None:
    """Render a reference on a cluster: by rows of lenses, or by samples where it has a list of lenses.

    Parts are stored in a hidden folder beside the reference until all are there; the same call continues from them.
    """
    folder, parts, done = FrameFolder(request.output), list[Request](), list[Path]()
    folder.check_free(request.kind)
    hidden = f".{folder.path.name}-workers-"

    def tasks(workers: int) -> Iterator[Task]:
        parts.extend(reference_parts(request, PARTS_PER_WORKER * workers, hidden))
        return ((Path(part.output).name, functools.partial(make, part, blender=blender)) for part in parts)

    for results in results_of(tasks, address, folder.path.parent, request.scene):
        done.append(Path(results[0].folder))
        tell(Progress("reference", len(done) / len(parts), f"{len(done)} of {len(parts)} parts"))
    merge(done, folder.path, tell)
    for path in folder.path.parent.glob(f"{hidden}*"):
        shutil.rmtree(path, ignore_errors=True)


def reference_parts(request: Request, most: int, hidden: str) -> list[Request]:
    """Return at most ``most`` requests that together are ``request``, in a folder named by what decides the pixels."""
    height, pairs = request.display.lenses[1], request.sampling.samples // 2
    count = min(most, height if request.lens_list is None else pairs)
    folder = Path(request.output).with_name(
        hidden + digest([request_facts(request), scene_stamp(request.scene), count]))
    parts = [dataclasses.replace(request, output=str(folder / str(number + 1))) for number in range(count)]
    if request.lens_list is None:
        return [dataclasses.replace(part, rows=parse_rows(f"{n + 1}/{count}", height)) for n, part in enumerate(parts)]
    samples = [2 * ((number + 1) * pairs // count - number * pairs // count) for number in range(count)]
    samples[0] += request.sampling.samples % 2
    return [dataclasses.replace(part.sampled(samples=samples[number]), seed=request.seed + number)
            for number, part in enumerate(parts)]


def results_of(tasks: Callable[[int], Iterator[Task]], address: str, output: Path, scene: str) -> Iterator[list[Made]]:
    """Have a scheduler's workers do ``tasks``, called with their number; yield each result.

    LfsrError where no scheduler answers or no worker is left, where a worker does not see the folder ``output`` or
    the file ``scene`` under the same path, or with a task's own sentence.
    """
    try:
        import distributed
    except ImportError:
        raise LfsrError("a cluster needs the package distributed: install the extra 'farm', as by pip install "
                        "'lfsr[farm]'") from None
    if not address.strip():  # Dask would start a cluster of its own
        raise LfsrError("the address of a scheduler is empty: give one, as tcp://host:8786")
    package: Any = distributed  # has no types
    place = output / f".lfsr-place-{secrets.token_hex(4)}"  # by which workers recognise the folder
    with contextlib.ExitStack() as stack:
        stack.callback(logging.disable, logging.root.manager.disable)
        logging.disable(logging.CRITICAL)  # distributed's log has tracebacks of what is told here in a sentence
        try:
            client = stack.enter_context(package.Client(address, timeout=SECONDS_TO_CONNECT, set_as_default=False))
        except (OSError, ValueError, MemoryError) as error:  # MemoryError: a length that another server's bytes state
            raise LfsrError(f"{address} cannot be reached as a Dask scheduler ({error}): start one by `dask scheduler` "
                            "and give its address, as tcp://host:8786") from None
        with system_errors(output):
            output.mkdir(parents=True, exist_ok=True)
            place.touch()
        stack.callback(place.unlink, missing_ok=True)
        if not (workers := client.scheduler_info(n_workers=-1)["workers"]):
            raise LfsrError("the scheduler has no workers: start some by `dask worker ADDRESS`")
        uses = all(RESOURCE in worker.get("resources", {}) for worker in workers.values())
        submitted = [client.submit(_work, function, str(place), scene, retries=RETRIES, pure=False,
                                   key=f"lfsr-{name}-{place.name[-8:]}", resources={RESOURCE: 1} if uses else None)
                     for name, function in tasks(len(workers))]
        stack.callback(client.cancel, submitted)
        stack.enter_context(client.as_current())
        waiting = set(submitted)
        while waiting:
            try:
                ended = package.wait(waiting, timeout=SECONDS_WITHOUT_WORKERS, return_when="FIRST_COMPLETED").done
                yield from (task.result() for task in ended)
                waiting -= ended
            except (TimeoutError, package.TimeoutError):
                if not client.scheduler_info(n_workers=-1)["workers"]:
                    raise LfsrError(f"{address} has no worker: start some by `dask worker ADDRESS`, {AGAIN}") from None
            except package.KilledWorker as error:
                raise LfsrError(f"workers died over the same work ({error.task}): check that their machines have "
                                f"enough memory, {AGAIN}") from None
            except (concurrent.futures.CancelledError, OSError):
                raise LfsrError(f"the scheduler {address} has ended: start it and its workers, {AGAIN}") from None


def _work(function: Callable[[], list[Made]], place: str, scene: str) -> list[Made]:
    """Do a task, on a worker that sees the folder and the scene."""
    for path, what in ((Path(place), f"folder {Path(place).parent}"), (Path(scene), f"scene {scene}")):
        if not path.is_file():
            raise LfsrError(f"a worker does not see the {what}: make it visible on its machine under the same path")
    return function()
