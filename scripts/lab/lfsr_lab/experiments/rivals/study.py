"""Compare with methods of others, with their own stored weights, on our renders and on captured light fields.

CLONES is a folder with clones of the public repositories, under their own names: lfepicnn and Sheared-EPI (of
GaochangWu), LightFieldAngularSR (angularsr), LightField_Denoising (tsfeith-epfl), epinet (chshin10), and LFBM5D
(V-Sense) with its program compiled as its README says. Nothing is fetched. A repository without a licence may be
measured, not shipped. OUT/rivals.json is the record, OUT/rivals.md its tables; the run can be stopped and repeated.
"""

from __future__ import annotations

import argparse
import functools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.files import read_json, write_json
from lfsr_core.base.records import to_data
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.metrics.intervals import student_95
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, PREFILTER, names
from lfsr_lab.experiments.engine.records import Records, method_facts, to_stderr
from lfsr_lab.experiments.engine.renders import REFERENCE, Store, digest, frame_digest
from lfsr_lab.experiments.engine.report import UNKNOWN, markdown_table, write_text
from lfsr_lab.experiments.engine.truth import Truth
from lfsr_lab.experiments.rivals.captured import OURS, TASKS, Likeness, Task, likeness, made, methods, read_field
from lfsr_lab.experiments.rivals.captured import VERSION as CAPTURED_VERSION
from lfsr_lab.experiments.rivals.measure import (
    NARROW,
    SAMPLES,
    SCALES,
    SCENES,
    VERSION,
    VIEWS,
    WIDE,
    Row,
    View,
    denoisers,
    fill,
    folder_of,
    measure,
    place,
)

Rows = dict[tuple[str, View, str], Row]  # by scene, render and denoiser
Captured = dict[tuple[str, str], Likeness]  # by task and method
Record = dict[str, Any]
TEMPLATE = Path(__file__).parent / "page.txt"
UPSCALER = DEFAULT_METHOD.removeprefix("denoise+")
# A record keeps the names of what it measured: "epi" was the end of the default before "pool".
SHOWN = (*(f"denoise+{name}" for name in ("bilinear", "bilinear+epi", "pool", "AngularSR-2", "Sheared-EPI", "EPICNN")),
         "oidn+bilinear", "LFBM5D+bilinear", "LFBM5D+AngularSR-2", "LFDnPatch+bilinear")
OF_CAPTURED = ("bilinear", "bicubic", "bilinear+epi", "AngularSR-2", "Sheared-EPI", "EPICNN")
SSIM, PSNR, SECONDS = range(3)  # places in an entry


def record(rows: Rows, captured: Captured) -> Record:
    """Return everything measured as plain JSON: means over lenses, and differences from the default."""
    scenes: Record = {}
    for (scene, view, denoiser), row in rows.items():
        default = rows[scene, View(view.scale, view.samples, view.width), "denoise"].followers[UPSCALER]
        of_view = scenes.setdefault(scene, {}).setdefault(view.name, {})
        for follower, figures in row.followers.items():
            each = np.subtract(figures.ssim, default.ssim)
            half = student_95(len(each) - 1) * each.std(ddof=1) / math.sqrt(len(each)) if len(each) > 1 else 0.0
            of_view[f"{denoiser}+{follower}"] = [round(float(np.mean(figures.ssim)), 4), round(figures.psnr, 2),
                                                 round(row.cpu_seconds + figures.cpu_seconds, 2),
                                                 round(float(each.mean()), 4), round(float(half), 4)]
    tasks: Record = {}
    for (task, method), found in captured.items():
        tasks.setdefault(task, {})[method] = [round(found.psnr, 2), round(found.ssim, 4)]
    return {"default": DEFAULT_METHOD,
            "columns": ["ssim_lens_fg", "psnr_fg", "cpu_seconds", "ssim_minus_default", "half_width_95"],
            "groups": {name: group for name, (_, group) in SCENES.items() if name in scenes}, "scenes": scenes,
            "captured_columns": ["psnr_y", "ssim_y"], "captured": tasks}


def markdown(found: Record) -> str:
    seven, three = (renders_table(found, scale) for scale in SCALES)
    return TEMPLATE.read_text(encoding="utf-8").format(
        scenes=", ".join(found["scenes"]), seven="\n".join(seven), three="\n".join(three),
        captured="\n".join(captured_table(found)), **_gaps(found))


def renders_table(found: Record, scale: int) -> list[str]:
    """Return the table of a scale: means over scenes."""
    views = [View(scale, samples, width) for samples in SAMPLES[::-1] for width in (WIDE, NARROW)]
    header = [f"scale {scale}", *(f"{view.samples}, {view.width}" for view in views), "CPU s"]
    return markdown_table(header, [
        [f"`{method}`", *(_cell(found, view, method, view.samples == SAMPLES[-1]) for view in views),
         f"{mean(found, views[0], method, SECONDS):.1f}"]
        for method in SHOWN if math.isfinite(mean(found, views[0], method, SSIM))], "lr")


def mean(found: Record, view: View, method: str, place: int) -> float:
    """Return the mean over all scenes of a figure of a method; NaN where it was not measured."""
    values = [of_scene[view.name][method][place] for of_scene in found["scenes"].values()
              if method in of_scene.get(view.name, {})]
    return float(np.mean(values)) if values else math.nan


def _cell(found: Record, view: View, method: str, with_psnr: bool) -> str:
    ssim, psnr = (mean(found, view, method, place) for place in (SSIM, PSNR))
    if not math.isfinite(ssim):
        return UNKNOWN
    return f"{ssim:.3f}".removeprefix("0") + (f", {psnr:.1f}" if with_psnr else "")


def captured_table(found: Record) -> list[str]:
    """Return the table of captured light fields: PSNR in dB."""
    tasks = {task.name: found["captured"][task.name] for task in TASKS if task.name in found["captured"]}
    return markdown_table(["dB", *tasks], [
        [f"`{name}`", *(f"{of_task[name][0]:.1f}" if name in of_task else UNKNOWN for of_task in tasks.values())]
        for name in OF_CAPTURED], "lr")


def _gaps(found: Record) -> dict[str, str]:
    """Return the numbers of the page's sentences, by name."""
    wide, narrow = (View(SCALES[0], SAMPLES[-1], width) for width in (WIDE, NARROW))

    def above(scene: str, method: str, other: str, place: int) -> float:
        entries = found["scenes"].get(scene, {}).get(narrow.name, {})
        return entries[method][place] - entries[other][place] if method in entries else math.nan

    name, fine = found["default"], View(SCALES[1], SAMPLES[-1])
    default = mean(found, wide, name, SSIM)
    ours = next(other for other in (name.removeprefix("denoise+"), "bilinear") if other in OF_CAPTURED)
    return {"epicnn": _signed(mean(found, fine, "denoise+EPICNN", SSIM) - mean(found, fine, name, SSIM)),
            "narrow": _signed(mean(found, narrow, name, SSIM) - default),
            "deep_ssim": _signed(above("deep", "denoise+AngularSR-2", name, SSIM)),
            "deep_psnr": _decibels(above("deep", "denoise+AngularSR-2", name, PSNR)),
            "figures_ssim": _signed(above("figures", "LFBM5D+AngularSR-2", name, SSIM)),
            "figures_psnr": _decibels(above("figures", "LFBM5D+AngularSR-2", name, PSNR)),
            "filtered": _signed(above("truck", "LFBM5D+bilinear", "denoise+bilinear", SSIM)),
            "sheared": _decibels(_gain(found, "antinous 2→7", "Sheared-EPI", "bilinear")),
            "row": _decibels(_gain(found, "Amethyst 6→16", "EPICNN", ours)),
            "known": ", ".join(name for name, group in found["groups"].items() if group == "known")}


def _gain(found: Record, task: str, method: str, other: str) -> float:
    """Return by how many dB a method is above another on a captured light field."""
    entries = found["captured"].get(task, {})
    return entries[method][0] - entries[other][0] if {method, other} <= entries.keys() else math.nan


def _signed(number: float) -> str:
    return f"{number:+.3f}".replace("0.", ".").replace("-", "−") if math.isfinite(number) else UNKNOWN


def _decibels(number: float) -> str:
    return f"{number:.1f}" if math.isfinite(number) else UNKNOWN


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
            truth, records = Truth(where.folder / REFERENCE), Records(where.folder / CELLS, Row)
            for view in VIEWS:
                render = where.folder / folder_of(view)
                for denoiser in denoisers(view) if FrameFolder(render).holds() else ():
                    to_stderr(f"{name} {view.name} {denoiser}")
                    ours = method_facts(f"{denoiser}+pool") if denoiser in names(PREFILTER) else {}
                    facts = {"version": VERSION, "render": frame_digest(render),
                             "reference": frame_digest(truth.folder), "denoiser": denoiser, **ours}
                    found[name, view, denoiser] = records.get(
                        f"{view.name}-{denoiser}", facts, functools.partial(measure, render, truth, denoiser, clones))
    return found


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
