"""Renders that are kept: each is made once, when it is first asked for, and recognised when it is there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from lfsr_core.frames.frame import FRAME_FILE
from lfsr_core.frames.identity import check_same
from lfsr_core.frames.job import Job, check_scene
from lfsr_core.progress import ProgressBar
from lfsr_core.render.blender import find_blender
from lfsr_core.render.process import RENDERED_FILES, run_job

Render = Callable[[Job], None]


def is_complete(folder: Path, kind: str = "render") -> bool:
    """True if a render of this kind, or a reference, has left all it should in ``folder``."""
    return all((folder / name).exists() for name in (FRAME_FILE, *RENDERED_FILES[kind]))


def kept(job: Job, render: Render) -> Path:
    """The job's folder, made by ``render(job)`` unless it is complete; LfsrError if it holds another render."""
    folder = Path(job.output)
    if not is_complete(folder, job.kind):
        render(job)
    check_same(folder, job)
    return folder


class Bar(Protocol):
    """What shows progress: a ``ProgressBar``, or a part of a longer one."""

    def __call__(self, stage: str, fraction: float, message: str) -> None:
        """Show one state."""

    def note(self, message: str) -> None:
        """Show a line that stays."""

    def close(self) -> None:
        """The render is done, or has failed."""


def with_blender(executable: str | None = None, announce: bool = True, bar: Bar | None = None) -> Render:
    """Renders in Blender, looked for when the first job comes; ``bar`` shows how far each is, None: one of its own.

    ``announce``: a line stays of each.
    """
    def render(job: Job) -> None:
        check_scene(job.scene)
        blender, shown_in = find_blender(executable), bar or ProgressBar()
        if announce:
            shown_in.note(f"rendering {job.output}: {job.spp} samples at scale {job.scale}")
        try:
            run_job(job, blender, shown_in, shown_in.note)
        finally:
            shown_in.close()
    return render
