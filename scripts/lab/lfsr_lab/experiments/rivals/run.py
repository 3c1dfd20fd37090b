"""Renders, measurements and captured light fields, each kept as a record, so that a run that was stopped goes on."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from pathlib import Path

from lfsr_core.base.arrays import Array
from lfsr_core.base.records import to_data
from lfsr_core.pipeline.store import is_complete
from lfsr_core.reconstruct.methods import PREFILTER, names
from lfsr_lab.experiments.engine.cells import to_stderr
from lfsr_lab.experiments.engine.records import Fingerprint, Records, method_facts
from lfsr_lab.experiments.engine.renders import REFERENCE, Store, digest, frame_digest
from lfsr_lab.experiments.engine.truth import Truth
from lfsr_lab.experiments.rivals.captured import OURS, TASKS, Likeness, Task, likeness, made, methods, read_field
from lfsr_lab.experiments.rivals.captured import VERSION as CAPTURED_VERSION
from lfsr_lab.experiments.rivals.measure import VERSION, Row, denoisers, measure
from lfsr_lab.experiments.rivals.renders import SCENES, VIEWS, View, fill, folder_of, place

CELLS = "cells"
Rows = dict[tuple[str, View, str], Row]  # by scene, render and denoiser


def scenes(folders: Sequence[Path], clones: Path, store: Store, only: Sequence[str] = ()) -> Rows:
    """Render and measure what is missing of the scenes that are below one of ``folders``."""
    found: Rows = {}
    for name in only or SCENES:
        where = place(name, store, folders)
        if where is None:
            continue
        if store.may_render:
            fill(where)
        if is_complete(where.folder / REFERENCE, "reference"):
            found |= {(name, *key): row for key, row in _measured(where.folder, clones).items()}
    return found


def _measured(scene: Path, clones: Path) -> dict[tuple[View, str], Row]:
    truth, records, found = Truth(scene / REFERENCE), Records(scene / CELLS, Row), {}
    for view in VIEWS:
        render = scene / folder_of(view)
        for denoiser in denoisers(view) if is_complete(render) else ():
            to_stderr(f"{scene.name} {view.name} {denoiser}")
            found[view, denoiser] = records.get(f"{view.name}-{denoiser}", _facts(render, truth.folder, denoiser),
                                                functools.partial(measure, render, truth, denoiser, clones))
    return found


def _facts(render: Path, reference: Path, denoiser: str) -> Fingerprint:
    ours = method_facts(f"{denoiser}+bilinear+epi") if denoiser in names(PREFILTER) else {}
    return {"version": VERSION, "render": frame_digest(render), "reference": frame_digest(reference),
            "denoiser": denoiser, **ours}


def captured(clones: Path, folder: Path) -> dict[tuple[str, str], Likeness]:
    """Make the views that are left out of captured light fields, and compare them; by task and method."""
    records, found = Records(folder / CELLS, Likeness), {}
    for task in TASKS:
        views = read_field(clones, task)
        for name in methods(task, views):
            to_stderr(f"{task.name} {name}")
            facts = {"version": CAPTURED_VERSION, "task": to_data(task), "views": digest(views.tobytes()),
                     "method": name, **(method_facts(name) if name in OURS else {})}
            found[task.name, name] = records.get(f"{task.field}-{task.given}-{task.made}-{name}", facts,
                                                 functools.partial(_remade, views, task, name, clones))
    return found


def _remade(views: Array, task: Task, name: str, clones: Path) -> Likeness:
    return likeness(made(views, task, name, clones), views, task.ratio)
