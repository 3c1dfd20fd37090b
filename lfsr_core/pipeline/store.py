"""Cached renders: each is made when it is first asked for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from lfsr_core.base.progress import ProgressBar
from lfsr_core.frames.frame import FRAME_FILE
from lfsr_core.frames.identity import check_same
from lfsr_core.frames.request import Request, check_scene
from lfsr_core.pipeline.rendering import RENDERED_FILES, run_job
from lfsr_core.process.blender import find_blender

Render = Callable[[Request], None]


def is_complete(folder: Path, kind: str = "render") -> bool:
    """True if ``folder`` has all files of a render, or of a reference where that is the ``kind``."""
    return all((folder / name).exists() for name in (FRAME_FILE, *RENDERED_FILES[kind]))


def cached(job: Request, render: Render) -> Path:
    """Return the job's folder, rendered by ``render(job)`` unless it is complete; LfsrError if it holds another one."""
    folder = Path(job.output)
    if not is_complete(folder, job.kind):
        render(job)
    check_same(folder, job)
    return folder


def with_blender(executable: str | None = None, announce: bool = True) -> Render:
    """Return a function that renders jobs in Blender, which is looked for when the first job comes.

    ``executable``: Blender, None for the best there is; ``announce``: print a line that stays for each job.
    """
    def render(job: Request) -> None:
        check_scene(job.scene)
        blender, bar = find_blender(executable), ProgressBar()
        if announce:
            bar.note(f"rendering {job.output}: {job.sampling.samples} samples at scale {job.sampling.scale}")
        try:
            run_job(job, blender, bar, bar.note)
        finally:
            bar.close()
    return render
