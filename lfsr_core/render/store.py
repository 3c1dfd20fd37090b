"""Renders that are kept: each is made once, when it is first asked for, and recognised when it is there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from lfsr_core.errors import LfsrError
from lfsr_core.frames.frame import FRAME_FILE, LAYOUTS, SUBPIXELS, Frame, read_part
from lfsr_core.frames.job import Job, check_scene
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.lens_rows import rows_text
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


def check_same(folder: Path, job: Job) -> None:
    """LfsrError unless ``folder`` holds what ``job`` asks for.

    A reference may have other samples and lenses: all that use one ask it which. A device that
    does not run the OSL camera renders through the lens card where one pass was asked for.
    """
    found, wanted = fingerprint(read_part(folder)), fingerprint(job)
    free = {"samples", "lens_list"} if job.kind == "reference" else set()
    free |= {"layout"} if job.layout == LAYOUTS[0] and found["layout"] != SUBPIXELS else set()
    free |= {"scale", "samples"} if found["scale"] in job.scales else set()
    for name in (name for name in wanted if name not in free):
        if found[name] != wanted[name]:
            raise LfsrError(f"{folder} was rendered with {name.replace('_', ' ')} {_shown(found[name], wanted[name])}, "
                            f"but {_shown(wanted[name], found[name])} is needed: choose another folder")


def fingerprint(render: Job | Frame) -> dict[str, Any]:
    """What a finished render and the job it was made for have in common, and two different renders do not."""
    return {"display": render.display, "scale": render.scale, "convention": render.convention,
            "layout": render.layout, "samples": render.spp if isinstance(render, Job) else render.samples,
            "lens_list": render.lens_list, "rows": render.rows}


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


def _shown(value: Any, other: Any) -> Any:
    """``value`` in a sentence: displays by name, or by what differs under one name, lists of lenses by their number."""
    if any(isinstance(of, tuple) and isinstance(of[0], int) for of in (value, other)):
        return rows_text(value) if value else "1 to the last"
    if isinstance(value, tuple) or value is None:
        return f"of {len(value)} lenses" if value else "of all lenses"
    if not isinstance(value, DisplayProfile) or value.name != other.name:
        return getattr(value, "name", value)
    differing = next(name for name in vars(value) if getattr(value, name) != getattr(other, name))
    return f"{value.name} of {differing}={getattr(value, differing)!r}"
