"""Compare with methods of others, with their own stored weights, on our renders and on captured light fields.

CLONES is a folder with clones of the public repositories, under their own names: lfepicnn and Sheared-EPI (of
GaochangWu), LightFieldAngularSR (angularsr), LightField_Denoising (tsfeith-epfl), epinet (chshin10), and LFBM5D
(V-Sense) with its program compiled as its README says. Nothing is fetched. A repository without a licence may be
measured, not shipped. OUT/rivals.json is the record, OUT/rivals.md its tables; the run can be stopped and repeated.
"""

from __future__ import annotations

import argparse
import functools
from collections.abc import Sequence
from pathlib import Path

from lfsr_core.base.arrays import Array
from lfsr_core.base.files import read_json, write_json
from lfsr_core.base.records import to_data
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.reconstruct.methods import PREFILTER, names
from lfsr_lab.experiments.engine.records import Fingerprint, Records, method_facts, to_stderr
from lfsr_lab.experiments.engine.renders import REFERENCE, Store, digest, frame_digest
from lfsr_lab.experiments.engine.report import write_text
from lfsr_lab.experiments.engine.truth import Truth
from lfsr_lab.experiments.rivals.captured import OURS, TASKS, Likeness, Task, likeness, made, methods, read_field
from lfsr_lab.experiments.rivals.captured import VERSION as CAPTURED_VERSION
from lfsr_lab.experiments.rivals.measure import (
    SCENES,
    VERSION,
    VIEWS,
    Row,
    View,
    denoisers,
    fill,
    folder_of,
    measure,
    place,
)
from lfsr_lab.experiments.rivals.page import markdown, record

RECORD = "rivals.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("clones", type=Path, metavar="CLONES", help="folder with the clones")
    add("--scenes", type=Path, nargs="+", default=(), metavar="FOLDER", help="folders of our scenes; default: none")
    add("--only", nargs="+", choices=SCENES, default=(), metavar="NAME", help="some of the scenes")
    add("--only-measure", action="store_true", help="render nothing")
    add("--no-captured", action="store_true", help="leave captured light fields out")


def run(arguments: argparse.Namespace) -> None:
    """Render and measure what is missing, then write the record and its tables."""
    folder, clones = arguments.output, arguments.clones
    store = Store(folder, arguments.blender, may_render=not arguments.only_measure)
    rows = rendered_scenes(arguments.scenes, clones, store, arguments.only)
    views = {} if arguments.no_captured else captured_views(clones, folder / "captured")
    write_json(folder / RECORD, record(rows, views))
    text = markdown(read_json(folder / RECORD, "a record"))
    print(write_text(folder / "rivals.md", text).read_text(encoding="utf-8"))


CELLS = "cells"
Rows = dict[tuple[str, View, str], Row]  # by scene, render and denoiser


def rendered_scenes(folders: Sequence[Path], clones: Path, store: Store, only: Sequence[str] = ()) -> Rows:
    """Render and measure what is missing of the scenes that are below one of ``folders``."""
    found: Rows = {}
    for name in only or SCENES:
        where = place(name, store, folders)
        if where is None:
            continue
        if store.may_render:
            fill(where)
        if FrameFolder(where.folder / REFERENCE).holds("reference"):
            found |= {(name, *key): row for key, row in _measured(where.folder, clones).items()}
    return found


def _measured(scene: Path, clones: Path) -> dict[tuple[View, str], Row]:
    truth, records, found = Truth(scene / REFERENCE), Records(scene / CELLS, Row), {}
    for view in VIEWS:
        render = scene / folder_of(view)
        for denoiser in denoisers(view) if FrameFolder(render).holds() else ():
            to_stderr(f"{scene.name} {view.name} {denoiser}")
            found[view, denoiser] = records.get(f"{view.name}-{denoiser}", _facts(render, truth.folder, denoiser),
                                                functools.partial(measure, render, truth, denoiser, clones))
    return found


def _facts(render: Path, reference: Path, denoiser: str) -> Fingerprint:
    ours = method_facts(f"{denoiser}+bilinear+epi") if denoiser in names(PREFILTER) else {}
    return {"version": VERSION, "render": frame_digest(render), "reference": frame_digest(reference),
            "denoiser": denoiser, **ours}


def captured_views(clones: Path, folder: Path) -> dict[tuple[str, str], Likeness]:
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
