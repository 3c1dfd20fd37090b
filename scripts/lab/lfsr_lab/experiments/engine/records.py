"""What a study makes and measures, stored at once: scenes, renders and references, each made once, and its cells."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import hashlib
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Generic, TypeVar

from lfsr_core.base.arrays import Mask
from lfsr_core.base.messages import LfsrError
from lfsr_core.base.records import from_data, read_record, to_data, write_record
from lfsr_core.base.system import read_json, write_json
from lfsr_core.commands.common import ProgressBar
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.frames.frame import FRAME_FILE, LOW_RES_FILE, Request, Sampling, read_frame
from lfsr_core.images.image_files import read_finite
from lfsr_core.optics.rays import choose_lenses
from lfsr_core.pipeline.make import make
from lfsr_core.process.child import find_blender
from lfsr_core.reconstruct.upscaler import foreground_mask
from lfsr_lab.experiments.engine.report import load_average
from lfsr_lab.networks.methods import LabMethod
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
            recorded = read_record(path, type(settings), "the settings of a study")
            for field in dataclasses.fields(settings):
                if getattr(recorded, field.name) != getattr(settings, field.name):
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
        """As ``rendered``; None where it is missing and may not be made."""
        return self.rendered(job) if self.may_render or FrameFolder(job.output).holds(job.kind) else None

    def rendered(self, job: Request) -> Path:
        """Return the folder of a render or reference, made if it is missing."""
        self.render_all([job])
        return Path(job.output)

    def render_all(self, jobs: Sequence[Request]) -> None:
        """Render what is missing of ``jobs``.

        LfsrError where a folder holds another render. A reference that is there may have any samples and lenses.
        """
        wanted = {job.output: job for job in jobs}.values()  # values of a sweep may share a reference
        if missing := [job for job in wanted if not FrameFolder(job.output).holds(job.kind)]:
            with contextlib.closing(ProgressBar()) as bar:
                bar.note(f"rendering {missing[0].output}" + (f" and {len(missing) - 1} more" if missing[1:] else ""))
                make(missing, blender=self.blender, tell=bar)
        for job in jobs:
            check_render(job)


def check_render(job: Request) -> None:
    """LfsrError with the first difference unless the job's folder holds its render; a subject only if it is named."""
    names = ("display", "convention", "layout", "lens_list", "rows", "scale", "samples", "world_visible",
             *(["subject"] if job.subject else []))
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


Record = TypeVar("Record")
Fingerprint = Mapping[str, Any]


@dataclasses.dataclass
class Records(Generic[Record]):
    """A folder of measured records, one JSON file each, with the fingerprint of what each depends on."""

    folder: Path  # where the files are
    kind: type[Record]  # class of the records, a frozen dataclass
    load: float | None = None  # highest load average after any measurement that was read or made, None if unknown

    def path(self, name: str) -> Path:
        return self.folder / f"{name}.json"

    def read(self, name: str, fingerprint: Fingerprint) -> Record | None:
        """Return the record ``name``, None if it is missing or damaged or has another fingerprint."""
        try:
            stored = read_json(self.path(name), "a measurement")
            if not isinstance(stored, dict) or stored.get("fingerprint") != fingerprint:
                return None
            record = from_data(self.kind, stored.get("record"), str(self.path(name)))
        except LfsrError:  # it can be measured again
            return None
        self._note(stored.get("load"))
        return record

    def write(self, name: str, fingerprint: Fingerprint, record: Record) -> None:
        """Store a record with its fingerprint, which must be plain JSON."""
        load = load_average()
        self._note(load)
        write_json(self.path(name), {"fingerprint": dict(fingerprint), "load": load, "record": to_data(record)})

    def get(self, name: str, fingerprint: Fingerprint, measure: Callable[[], Record]) -> Record:
        """Return the record ``name``, measured and stored now unless it is there with this fingerprint."""
        record = self.read(name, fingerprint)
        if record is None:
            record = measure()
            self.write(name, fingerprint, record)
        return record

    def _note(self, load: float | None) -> None:
        self.load = max((average for average in (self.load, load) if average is not None), default=None)


def method_facts(name: str) -> dict[str, Any]:
    """Return what a measurement of a method depends on besides its render: weights and versions, plain JSON."""
    method = LabMethod.parse(name)
    return {"weights": method.weights_digest, "versions": method.name.versions}


@dataclasses.dataclass(frozen=True)
class StudySettings:
    """Settings of a study, which adds its own fields; they stand in its records."""

    @classmethod
    def given(cls, arguments: argparse.Namespace) -> dict[str, Any]:
        """Return the fields that a command line gives."""
        names = {field.name for field in dataclasses.fields(cls)}
        return {name: value for name, value in vars(arguments).items() if name in names and value is not None}


@dataclasses.dataclass(frozen=True)
class Cell(Generic[Record]):
    name: str  # of its record
    inputs: Fingerprint  # what it depends on, plain JSON: method, weights, versions, settings
    measure: Callable[[], Record]  # called when all renders are there
    jobs: Sequence[Request] = ()  # renders and references that it needs


def to_stderr(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def measured(cells: Iterable[Cell[Record]], records: Records[Record], store: Store) -> Iterator[Record]:
    """Yield the record of every cell; what is missing is rendered and measured now, and stored at once.

    Parameters
    ----------
    cells : what to measure, in order
    records : where records are stored
    store : where renders are
    """
    for cell in cells:
        record = records.read(cell.name, cell.inputs)
        if record is None:
            store.render_all(cell.jobs)
            to_stderr(f"measuring {records.folder / cell.name}")
            record = cell.measure()
            records.write(cell.name, cell.inputs, record)
        yield record
