"""The store of a study: scenes, renders and references in one folder, each made once."""

from __future__ import annotations

import dataclasses
import hashlib
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from lfsr_core.base.arrays import Mask
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import write_json
from lfsr_core.base.notices import ProgressBar
from lfsr_core.base.records import read_record, write_record
from lfsr_core.commands.sentences import sentence
from lfsr_core.frames.folder import RAYS, FrameFolder
from lfsr_core.frames.frame import FRAME_FILE, LOW_RES_FILE, read_frame
from lfsr_core.frames.low_res import foreground_mask
from lfsr_core.frames.request import Request, Sampling, check_scene
from lfsr_core.images.exr import read_finite
from lfsr_core.optics.lenses import choose_lenses
from lfsr_core.pipeline.make import render_all
from lfsr_core.process.blender import find_blender
from lfsr_lab.scenes import run_script, scene_script

SETTINGS_FILE, SCENE_FILE, REFERENCE = "settings.json", "scene.blend", "reference"


@dataclasses.dataclass(frozen=True)
class Store:
    folder: Path
    blender: str | None = None  # executable, None for the best there is
    may_render: bool = True  # False: a render that is missing is left out

    def claim(self, settings: Any) -> None:
        """Record the settings of a new folder; LfsrError if it was begun with other ones."""
        path = self.folder / SETTINGS_FILE
        if path.exists():
            found = read_record(path, type(settings), "the settings of a study")
            for field in dataclasses.fields(settings):
                if getattr(found, field.name) != getattr(settings, field.name):
                    raise LfsrError(f"{self.folder} was begun with other settings ({field.name} differs, see "
                                    f"{SETTINGS_FILE} there): choose another folder or the same settings")
        write_record(path, settings)

    def build(self, script: str, wanted: Mapping[Path, Mapping[str, Any]], **shared: Any) -> None:
        """Write the scene files that are missing, all in one Blender.

        Parameters
        ----------
        script : name of the script of lfsr_lab.scenes that builds them
        wanted : what the script is told of each scene, by the file to write
        shared : what it is told of all
        """
        missing = [{**facts, "path": str(path.resolve())} for path, facts in wanted.items() if not path.exists()]
        if not missing:
            return
        print(f"building {len(missing)} scenes", flush=True)
        for path in wanted:
            path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory() as name:
            job = Path(name) / "scenes.json"
            write_json(job, {**shared, "scenes": missing})
            run_script(find_blender(self.blender), scene_script(script), job, list(wanted))

    def render(self, job: Request) -> Path | None:
        """Return the folder of a render or reference, made if it is missing; None where it is and may not be made."""
        missing = not FrameFolder(job.output).holds(job.kind)
        return None if missing and not self.may_render else self.rendered(job)

    def rendered(self, job: Request) -> Path:
        """Return the folder of a render or reference, made if it is missing."""
        self.render_all([job])
        return Path(job.output)

    def render_all(self, jobs: Sequence[Request], done: Callable[[Request], object] = lambda job: None) -> None:
        """Render what is missing of ``jobs`` in one Blender; ``done`` is called with each job that is rendered.

        LfsrError where a folder holds another render. A reference that is there may have any samples and lenses.
        """
        wanted = {job.output: job for job in jobs}.values()  # values of a sweep may share a reference
        missing = [job for job in wanted if not FrameFolder(job.output).holds(job.kind)]
        for job in missing:
            check_scene(job.scene)
        if missing:
            bar = ProgressBar(words=sentence)
            bar.note(f"rendering {missing[0].output}" + (f" and {len(missing) - 1} more" if missing[1:] else ""))
            try:
                render_all(missing, find_blender(self.blender), bar, done)
            finally:
                bar.close()
        for job in jobs:
            check_render(job)


def check_render(job: Request) -> None:
    """LfsrError with the first difference unless the job's folder holds its render; a subject only if it is named."""
    names = (*RAYS, "world_visible", *(["subject"] if job.subject else []))
    FrameFolder(job.output).check_rendered(job, names=names)


def reference_of(job: Request, samples: int, folder: Path, **changes: Any) -> Request:
    """Return the reference of a render's scene and display: every view, indirect light not clamped."""
    return dataclasses.replace(job, output=str(folder), kind="reference", sampling=Sampling(1, samples), layers=(),
                               clamp_indirect=0.0, **changes)


def sampled(reference: Request, count: int | None, render: Callable[[], Path | None]) -> Request:
    """Return the reference of ``count`` lenses, chosen by the foreground of ``render()``; of all lenses for None."""
    folder = None if count is None or FrameFolder(reference.output).holds("reference") else render()
    if count is None or folder is None:
        return reference
    return dataclasses.replace(reference, lens_list=choose_lenses(foreground(folder), count))


def foreground(folder: Path) -> Mask:
    """Return the lenses (sy, sx) of a render that see the foreground."""
    return foreground_mask(read_finite(folder / LOW_RES_FILE)[0], read_frame(folder).rays.tiles)


def frame_digest(folder: Path) -> str:
    """Return a short hash of a render's frame.json: another render has another one."""
    return digest((folder / FRAME_FILE).read_bytes())


def digest(data: bytes) -> str:
    """Return a short hash of bytes, as a part of a fingerprint."""
    return hashlib.sha256(data).hexdigest()[:16]
