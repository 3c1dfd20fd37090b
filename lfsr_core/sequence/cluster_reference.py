"""A reference on several workers: shares by rows of lenses or by samples, joined as ``lfsr merge`` does it.

Shares lie in a hidden folder beside the reference until all are there; the same call goes on from those that are.
"""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Iterator
from pathlib import Path

from lfsr_core.errors import LfsrError
from lfsr_core.frames.identity import digest, job_facts
from lfsr_core.frames.job import Job
from lfsr_core.optics.lens_rows import parse_rows
from lfsr_core.progress import Progress
from lfsr_core.render.blender import find_blender
from lfsr_core.render.content import scene_content
from lfsr_core.render.merge import merge
from lfsr_core.render.process import check_folder, run_job
from lfsr_core.render.store import is_complete
from lfsr_core.sequence.cluster import Cluster, Piece, Site, work_through

ROWS, SAMPLES = "rows", "samples"
SHARES_OF_A_WORKER = 2  # so that a fast one takes more
LEAST_SAMPLES = 2  # one for each half


@dataclasses.dataclass(frozen=True)
class Split:
    """How a reference becomes shares."""

    by: str = ROWS  # or SAMPLES
    shares: int | None = None  # None for two per worker


def reference_on(cluster: Cluster, job: Job, split: Split, blender: str | None, progress: Progress) -> None:
    """Render the reference of ``job`` into its output.

    Parameters
    ----------
    cluster : whose workers render
    job : of the kind "reference", of all rows
    split : how it becomes shares
    blender : executable on every worker, None for the best there is
    progress : called with (stage, fraction, message)

    Raises
    ------
    LfsrError : as of ``cluster.work_through``, or where there are more shares than rows or pairs of samples
    """
    output = Path(job.output)
    check_folder(output, job.kind)
    most = _most(job, split.by)
    if split.shares is not None and not 1 <= split.shares <= most:
        raise LfsrError(f"shares are {split.shares}, but split by {split.by} they must be 1 to {most}")
    made: list[Path] = []
    jobs: list[Job] = []

    def pieces(workers: int) -> Iterator[Piece]:
        jobs.extend(shares(job, split.by, split.shares or min(most, SHARES_OF_A_WORKER * workers)))
        return (Piece(Path(share.output).name, render_share, (share, blender)) for share in jobs)

    def took(folder: str) -> None:
        made.append(Path(folder))
        progress("reference", len(made) / len(jobs), f"{len(made)} of {len(jobs)} shares")

    work_through(cluster, Site(output.parent, job.scene), pieces, took)
    merge(made, output, progress)
    for folder in output.parent.glob(f"{_prefix(output)}*"):
        shutil.rmtree(folder, ignore_errors=True)


def shares(job: Job, by: str, count: int) -> list[Job]:
    """``count`` jobs that are the whole of ``job`` together, in folders that no other reference's shares have."""
    folder = _folder(job, by, count)
    if by == ROWS:
        height = job.display.lenses[1]
        return [dataclasses.replace(job, rows=parse_rows(f"{number}/{count}", height), output=str(folder / str(number)))
                for number in range(1, count + 1)]
    pairs = job.spp // 2
    samples = [2 * ((number + 1) * pairs // count - number * pairs // count) for number in range(count)]
    samples[0] += job.spp % 2
    return [dataclasses.replace(job, spp=spp, seed=job.seed + number, output=str(folder / str(number + 1)))
            for number, spp in enumerate(samples)]


def render_share(job: Job, blender: str | None) -> str:
    """Render one share unless it is there, on a worker; its folder."""
    if not is_complete(Path(job.output), job.kind):
        run_job(job, find_blender(blender))
    return job.output


def _most(job: Job, by: str) -> int:
    if by == ROWS and job.lens_list is not None:
        raise LfsrError("a sample of lenses cannot be split by rows: split it by samples")
    return job.display.lenses[1] if by == ROWS else job.spp // LEAST_SAMPLES


def _folder(job: Job, by: str, count: int) -> Path:
    """Named by all that decides the pixels, so that shares of another reference are never taken for this one's."""
    output = Path(job.output)
    return output.with_name(f"{_prefix(output)}{digest([job_facts(job), scene_content(job.scene), by, count])}")


def _prefix(output: Path) -> str:
    return f".{output.name}-shares-"
