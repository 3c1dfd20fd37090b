"""Compare with methods of others, with their own stored weights, on our renders and on captured light fields.

CLONES is a folder with clones of the public repositories, under their own names: lfepicnn and Sheared-EPI (of
GaochangWu), LightFieldAngularSR (angularsr), LightField_Denoising (tsfeith-epfl), epinet (chshin10), and LFBM5D
(V-Sense) with its program compiled as its README says. Nothing is fetched. A repository without a licence may be
measured, not shipped. OUT/rivals.json is the record, OUT/rivals.md its tables; the run can be stopped and repeated.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.records import to_data
from lfsr_core.base.system import read_json, write_json
from lfsr_core.frames.folder import FrameFolder
from lfsr_core.frames.frame import LOW_RES_FILE, Request, read_frame
from lfsr_core.images.color import srgb_decode, srgb_encode
from lfsr_core.images.image_files import clean, read_layers
from lfsr_core.metrics.eia_metrics import student_95
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, PREFILTER, load_method, names
from lfsr_core.reconstruct.second_stage import finished_lenses
from lfsr_core.reconstruct.upscaler import LowResEIA, low_resolution, read_world
from lfsr_lab.experiments.denoiser.study import Place, Render, Scene
from lfsr_lab.experiments.engine.records import REFERENCE, Records, Store, digest, frame_digest, method_facts, to_stderr
from lfsr_lab.experiments.engine.report import UNKNOWN, markdown_table, write_text
from lfsr_lab.experiments.engine.timing import children_cpu_seconds, cpu_seconds
from lfsr_lab.experiments.engine.truth import Figures, Truth, lens_ssims
from lfsr_lab.experiments.rivals.captured import OURS as CAPTURED_OURS
from lfsr_lab.experiments.rivals.captured import TASKS, Likeness, likeness, methods, read_field
from lfsr_lab.experiments.rivals.captured import VERSION as CAPTURED_VERSION
from lfsr_lab.experiments.rivals.makers import MAKERS, LFDnPatch, filtered, program

DISPLAY = str(Path(__file__).parent / "rivals.toml")
REFERENCE_SAMPLES = 1024  # in both halves together
LENSES = 20  # that a reference shows
SCALES = (7, 3)
SAMPLES = (4, 16)
WIDE, NARROW = "wide", "narrow"  # low views that fill their cells; low views of a finished view's width
SCENES = {  # file below one of the folders of scenes, by name; the group says whether methods were developed on it
    "helmet": ("helmet/FlightHelmet.gltf", "known"),
    "dragon": ("dragon/dragon.blend", "known"),
    "cloth": ("cloth.blend", "unseen"),
    "city": ("city.blend", "unseen"),
    "truck": ("CesiumMilkTruck/glTF/CesiumMilkTruck.gltf", "unseen"),
    "figures": ("figures.blend", "unseen"),
    "deep": ("deep.blend", "unseen")}


@dataclasses.dataclass(frozen=True, order=True)
class View:
    scale: int
    samples: int
    width: str = WIDE

    @property
    def name(self) -> str:
        return f"s{self.scale}-spp{self.samples}-{self.width}"


VIEWS = tuple(View(scale, samples, width) for scale in SCALES for width in (WIDE, NARROW) for samples in SAMPLES)


def place(name: str, store: Store, folders: Sequence[Path]) -> Place | None:
    """Return a scene of SCENES where its file is below one of ``folders``."""
    file, group = SCENES[name]
    scene_file = next((path for folder in folders if (path := folder / file).is_file()), None)
    scene = Scene(name, file, group, display=DISPLAY, scale=SCALES[0], lenses=LENSES)
    return Place(store, scene, scene_file) if scene_file else None


def folder_of(view: View) -> str:
    return _wide(view).folder if view.width == WIDE else view.name


def job(place: Place, view: View) -> Request:
    return dataclasses.replace(place.job(_wide(view)), output=str(place.folder / folder_of(view)),
                               view_aperture=view.scale if view.width == WIDE else 1.0)


def _wide(view: View) -> Render:
    return Render(view.scale, view.samples)


def fill(place: Place) -> None:
    place.store.render_all([place.reference(REFERENCE_SAMPLES), *(job(place, view) for view in VIEWS)])


VERSION = 1  # of how figures are measured
MOST_SHEAR = 4  # pixels between two low-resolution views, as in the demo of Sheared-EPI
OURS = ("bilinear", "bicubic", "pool")
# What follows a denoiser, by the scale. Sheared-EPI at scale 3 has 169 cells of views: minutes for each image.
FOLLOWERS = {7: (*OURS, "AngularSR-2", "Sheared-EPI"), 3: (*OURS, "EPICNN")}
AFTER_OTHERS = ("bilinear", "AngularSR-2")
OTHERS = ("LFBM5D", "LFDnPatch")
SLOW = ("Sheared-EPI",)  # after our denoiser alone


@dataclasses.dataclass(frozen=True)
class Row:
    cpu_seconds: float  # of denoising
    followers: dict[str, Figures]  # by the interpolation


def denoisers(view: View) -> tuple[str, ...]:
    """Return the denoisers that are measured on a render: to filter 196 views takes minutes."""
    return (*names(PREFILTER), *(OTHERS if view.scale == SCALES[0] else ()))


def measure(render: Path, truth: Truth, denoiser: str, clones: Path) -> Row:
    """Finish every lens in every way after a denoiser, and compare those that the reference shows."""
    layers, frame = clean(read_layers(render / LOW_RES_FILE))[0], read_frame(render)
    low = low_resolution(layers, frame, read_world(render, frame))
    without, seconds = _timed(lambda: denoised(low, denoiser, clones))
    names = AFTER_OTHERS if denoiser in OTHERS else FOLLOWERS[low.scale]
    names = tuple(name for name in names if name not in SLOW or denoiser == "denoise")
    made = {name: _timed(functools.partial(finished, without, name, clones)) for name in names}
    return Row(seconds, {name: _figures(*timed, truth, low.scale // 2) for name, timed in made.items()})


def _figures(images: Array, seconds: float, truth: Truth, margin: int) -> Figures:
    shown = images[tuple(truth.lenses.T)]
    a, b = (_inside(srgb_encode(half), margin) for half in truth.halves)
    squared = ((shown - a) * (shown - b)).mean((1, 2, 3), dtype=np.float64)
    return Figures(_values(lens_ssims(shown, a, b)), _values(squared), seconds)


def _timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """Return a result, and the processor seconds that it took in this process and its children."""
    started = cpu_seconds() + children_cpu_seconds()
    result = work()
    return result, round(cpu_seconds() + children_cpu_seconds() - started, 2)


def finished(low: LowResEIA, name: str, clones: Path) -> Array:
    """Return the elemental images (sy, sx, r·(h - 1) + 1, r·(w - 1) + 1, 3) of all lenses, display values."""
    if name in MAKERS:
        return MAKERS[name].load(clones, low.scale, MOST_SHEAR)(_views(low.color)).transpose(2, 3, 0, 1, 4)
    sy, sx = low.color.shape[:2]
    every = np.stack(np.divmod(np.arange(sy * sx), sx), -1)
    images = finished_lenses(low, np.ones(len(every), bool), name, every)
    images = _inside(srgb_encode(images), low.scale // 2)
    return images.reshape(sy, sx, *images.shape[1:])


def denoised(low: LowResEIA, denoiser: str, clones: Path) -> LowResEIA:
    """Return a low-resolution EIA without noise; light-field filters of others see views of display values."""
    if denoiser in names(PREFILTER):
        return load_method(denoiser).prepare(low)
    if denoiser == "LFDnPatch":
        views = LFDnPatch(clones)(_views(low.color))
    else:
        views = filtered(program(clones), _views(low.color))
    color = srgb_decode(views.transpose(2, 3, 0, 1, 4).astype(np.float32))
    return dataclasses.replace(low, color=color, noisy=low.color)


def _inside(images: Array, margin: int) -> Array:
    """Return the pixels of (n, py, px, 3) between the outermost low-resolution views."""
    return images[:, margin:-margin, margin:-margin]


def _views(color: Array) -> Array:
    """Return views (h, w, sy, sx, 3) of display values in [0, 1] of scene-linear EIs."""
    return np.ascontiguousarray(srgb_encode(color).transpose(2, 3, 0, 1, 4))


def _values(values: Array) -> tuple[float, ...]:
    return tuple(float(f"{value:.5g}") for value in values)


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
            gains = np.subtract(figures.ssim, default.ssim)
            half = student_95(len(gains) - 1) * gains.std(ddof=1) / math.sqrt(len(gains)) if len(gains) > 1 else 0.0
            of_view[f"{denoiser}+{follower}"] = [round(float(np.mean(figures.ssim)), 4), round(figures.psnr, 2),
                                                 round(row.cpu_seconds + figures.cpu_seconds, 2),
                                                 round(float(gains.mean()), 4), round(float(half), 4)]
    tasks: Record = {}
    for (task, method), accuracy in captured.items():
        tasks.setdefault(task, {})[method] = [round(accuracy.psnr, 2), round(accuracy.ssim, 4)]
    return {"default": DEFAULT_METHOD,
            "columns": ["ssim_lens_fg", "psnr_fg", "cpu_seconds", "ssim_minus_default", "half_width_95"],
            "groups": {name: group for name, (_, group) in SCENES.items() if name in scenes}, "scenes": scenes,
            "captured_columns": ["psnr_y", "ssim_y"], "captured": tasks}


def markdown(record: Record) -> str:
    def cell(view: View, method: str) -> str:
        ssim, psnr = (mean(record, view, method, place) for place in (SSIM, PSNR))
        if not math.isfinite(ssim):
            return UNKNOWN
        return f"{ssim:.3f}".removeprefix("0") + (f", {psnr:.1f}" if view.samples == SAMPLES[-1] else "")

    tables = []  # of each scale, means over scenes
    for scale in SCALES:
        views = [View(scale, samples, width) for samples in SAMPLES[::-1] for width in (WIDE, NARROW)]
        header = [f"scale {scale}", *(f"{view.samples}, {view.width}" for view in views), "CPU s"]
        rows = [[f"`{name}`", *(cell(view, name) for view in views), f"{mean(record, views[0], name, SECONDS):.1f}"]
                for name in SHOWN if math.isfinite(mean(record, views[0], name, SSIM))]
        tables.append("\n".join(markdown_table(header, rows, "lr")))
    captured = {task.name: record["captured"][task.name] for task in TASKS if task.name in record["captured"]}
    decibels = markdown_table(["dB", *captured], [
        [f"`{name}`", *(f"{of_task[name][0]:.1f}" if name in of_task else UNKNOWN for of_task in captured.values())]
        for name in OF_CAPTURED], "lr")
    wide, narrow = (View(SCALES[0], SAMPLES[-1], width) for width in (WIDE, NARROW))

    def above(scene: str, method: str, other: str, place: int) -> float:
        entries = record["scenes"].get(scene, {}).get(narrow.name, {})
        return entries[method][place] - entries[other][place] if method in entries else math.nan

    def gain(task: str, method: str, other: str) -> float:
        entries = captured.get(task, {})
        return entries[method][0] - entries[other][0] if {method, other} <= entries.keys() else math.nan

    name, fine = record["default"], View(SCALES[1], SAMPLES[-1])
    ours = next(other for other in (name.removeprefix("denoise+"), "bilinear") if other in OF_CAPTURED)
    return TEMPLATE.read_text(encoding="utf-8").format(
        scenes=", ".join(record["scenes"]), seven=tables[0], three=tables[1], captured="\n".join(decibels),
        epicnn=_signed(mean(record, fine, "denoise+EPICNN", SSIM) - mean(record, fine, name, SSIM)),
        narrow=_signed(mean(record, narrow, name, SSIM) - mean(record, wide, name, SSIM)),
        deep_ssim=_signed(above("deep", "denoise+AngularSR-2", name, SSIM)),
        deep_psnr=_decibels(above("deep", "denoise+AngularSR-2", name, PSNR)),
        figures_ssim=_signed(above("figures", "LFBM5D+AngularSR-2", name, SSIM)),
        figures_psnr=_decibels(above("figures", "LFBM5D+AngularSR-2", name, PSNR)),
        filtered=_signed(above("truck", "LFBM5D+bilinear", "denoise+bilinear", SSIM)),
        sheared=_decibels(gain("antinous 2→7", "Sheared-EPI", "bilinear")),
        row=_decibels(gain("Amethyst 6→16", "EPICNN", ours)),
        known=", ".join(scene for scene, group in record["groups"].items() if group == "known"))


def mean(record: Record, view: View, method: str, place: int) -> float:
    """Return the mean over all scenes of a figure of a method; NaN where it was not measured."""
    values = [of_scene[view.name][method][place] for of_scene in record["scenes"].values()
              if method in of_scene.get(view.name, {})]
    return float(np.mean(values)) if values else math.nan


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


def run(arguments: argparse.Namespace) -> None:
    """Render and measure what is missing, then write the record and its tables."""
    folder, clones = arguments.output, arguments.clones
    store = Store(folder, arguments.blender, may_render=not arguments.only_measure)
    rows = rendered_scenes(arguments.scenes, clones, store, arguments.only)
    write_json(folder / RECORD, record(rows, captured_views(clones, folder / "captured")))
    text = markdown(read_json(folder / RECORD, "a record"))
    print(write_text(folder / "rivals.md", text).read_text(encoding="utf-8"))


CELLS = "cells"


def rendered_scenes(folders: Sequence[Path], clones: Path, store: Store, only: Sequence[str] = ()) -> Rows:
    """Render and measure what is missing of the scenes that are below one of ``folders``."""
    rows: Rows = {}
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
                    rows[name, view, denoiser] = records.get(
                        f"{view.name}-{denoiser}", facts, functools.partial(measure, render, truth, denoiser, clones))
    return rows


def captured_views(clones: Path, folder: Path) -> dict[tuple[str, str], Likeness]:
    """Make the views that are left out of captured light fields, and compare them; by task and method."""
    records, likenesses = Records(folder / CELLS, Likeness), {}
    for task in TASKS:
        views = read_field(clones, task)
        for name in methods(task, views):
            to_stderr(f"{task.name} {name}")
            facts = {"version": CAPTURED_VERSION, "task": to_data(task), "views": digest(views.tobytes()),
                     "method": name, **(method_facts(name) if name in CAPTURED_OURS else {})}
            likenesses[task.name, name] = records.get(f"{task.field}-{task.given}-{task.made}-{name}", facts,
                                                      functools.partial(likeness, views, task, name, clones))
    return likenesses

