"""A reference on several workers: parts by rows of lenses or by samples, which are then merged.

Parts are stored in a hidden folder beside the reference until all are there; the same call continues from them.
"""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Iterator
from pathlib import Path

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.progress import Progress
from lfsr_core.frames.identity import digest, request_facts, scene_stamp
from lfsr_core.frames.request import Request
from lfsr_core.optics.lens_rows import parse_rows
from lfsr_core.pipeline.cluster import Cluster, Task, work_through
from lfsr_core.pipeline.merge import merge
from lfsr_core.pipeline.rendering import check_folder, run_job
from lfsr_core.pipeline.store import is_complete
from lfsr_core.process.blender import find_blender

ROWS, SAMPLES = "rows", "samples"
PARTS_PER_WORKER = 2  # so that a fast worker does more
LEAST_SAMPLES = 2  # one for each half


@dataclasses.dataclass(frozen=True)
class Split:
    """How a reference is divided into parts."""

    by: str = ROWS  # or SAMPLES
    parts: int | None = None  # None for two per worker


def reference_on(cluster: Cluster, job: Request, split: Split, blender: str | None, progress: Progress) -> None:
    """Render the reference of ``job``, of all rows, into its output.

    ``blender``: executable on every worker, None for the best there is. LfsrError as of ``cluster.work_through``, or
    where there are more parts than rows or pairs of samples.
    """
    output, most = Path(job.output), _most_parts(job, split.by)
    check_folder(output, job.kind)
    if split.parts is not None and not 1 <= split.parts <= most:
        raise LfsrError(f"parts are {split.parts}, but split by {split.by} they must be 1 to {most}")
    made: list[Path] = []
    jobs: list[Request] = []

    def tasks(workers: int) -> Iterator[Task]:
        jobs.extend(part_jobs(job, split.by, split.parts or min(most, PARTS_PER_WORKER * workers)))
        return (Task(Path(part.output).name, _render_part, (part, blender)) for part in jobs)

    def took(folder: str) -> None:
        made.append(Path(folder))
        progress("reference", len(made) / len(jobs), f"{len(made)} of {len(jobs)} parts")

    work_through(cluster, output.parent, job.scene, tasks, took)
    merge(made, output, progress)
    for folder in output.parent.glob(f"{_prefix(output)}*"):
        shutil.rmtree(folder, ignore_errors=True)


def part_jobs(job: Request, by: str, count: int) -> list[Request]:
    """Return ``count`` jobs that together are ``job``, in a folder that no other reference uses."""
    output = Path(job.output)
    # Named by what decides the pixels, so that parts of another reference are never mixed with these.
    folder = output.with_name(f"{_prefix(output)}{digest([request_facts(job), scene_stamp(job.scene), by, count])}")
    if by == ROWS:
        height = job.display.lenses[1]
        return [dataclasses.replace(job, rows=parse_rows(f"{number}/{count}", height), output=str(folder / str(number)))
                for number in range(1, count + 1)]
    pairs = job.sampling.samples // 2
    samples = [2 * ((number + 1) * pairs // count - number * pairs // count) for number in range(count)]
    samples[0] += job.sampling.samples % 2
    return [dataclasses.replace(job.sampled(samples=count), seed=job.seed + number,
                                output=str(folder / str(number + 1)))
            for number, count in enumerate(samples)]


def _render_part(job: Request, blender: str | None) -> str:
    """Render a part unless it is there, on a worker, and return its folder."""
    if not is_complete(Path(job.output), job.kind):
        run_job(job, find_blender(blender))
    return job.output


def _most_parts(job: Request, by: str) -> int:
    if by == ROWS and job.lens_list is not None:
        raise LfsrError("a sample of lenses cannot be split by rows: split it by samples")
    return job.display.lenses[1] if by == ROWS else job.sampling.samples // LEAST_SAMPLES


def _prefix(output: Path) -> str:
    return f".{output.name}-workers-"
