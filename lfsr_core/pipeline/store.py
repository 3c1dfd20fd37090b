"""Glue until every caller uses ``make``."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path

from lfsr_core.base.notices import Notice, Progress, Tell
from lfsr_core.base.progress import ProgressBar
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.frames.identity import check_same
from lfsr_core.frames.request import Request, check_scene
from lfsr_core.pipeline.rendering import render_all
from lfsr_core.process.blender import Starts, find_blender

Render = Callable[[Request], None]
Warn = Callable[[str], None]


@dataclasses.dataclass(frozen=True)
class Listener:
    """Functions that are called while renders run."""

    progress: Callable[[str, float, str], None] | None = None
    warn: Warn | None = None
    rendered: Callable[[Request], object] = lambda job: None


def _tell(progress: Callable[[str, float, str], None] | None, warn: Warn | None) -> Tell:
    def tell(told: Progress | Notice) -> None:
        if isinstance(told, Progress):
            if progress:
                progress(told.stage, told.fraction, told.detail)
        elif warn:
            warn(str(told.values.get("text", told)))
    return tell


def run_jobs(jobs: Sequence[Request], blender: Starts, listener: Listener) -> None:
    """As ``render_all``."""
    render_all(jobs, blender, _tell(listener.progress, listener.warn), listener.rendered)


def run_job(job: Request, blender: Starts, progress: Callable[[str, float, str], None] | None = None,
            warn: Warn | None = None) -> None:
    """Render one request."""
    render_all([job], blender, _tell(progress, warn))


def is_complete(folder: Path, kind: str = "render") -> bool:
    """As ``FrameFolder.holds``."""
    return FrameFolder(folder).holds(kind)


def cached(job: Request, render: Render) -> Path:
    """Return the folder, rendered unless it is there."""
    folder = Path(job.output)
    if not is_complete(folder, job.kind):
        render(job)
    check_same(folder, job)
    return folder


def with_blender(executable: str | None = None, announce: bool = True) -> Render:
    """Return a function that renders in Blender."""
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
