"""Accuracy of denoisers and interpolations, ours and those of others, on our renders.

A network makes no views beyond the outermost that it is given, so only the views within count, for all methods.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.frames.frame import LOW_RES_FILE, read_frame
from lfsr_core.frames.low_res import LowResEIA, low_resolution, read_world
from lfsr_core.frames.request import Request
from lfsr_core.images.exr import clean, read_layers
from lfsr_core.images.srgb import srgb_decode, srgb_encode
from lfsr_core.reconstruct.methods import PREFILTER, load_method, names
from lfsr_core.reconstruct.second_stage import finished_lenses
from lfsr_lab.experiments.denoiser.measure import Place, Render, Scene
from lfsr_lab.experiments.engine.renders import Store
from lfsr_lab.experiments.engine.timing import children_cpu_seconds, cpu_seconds
from lfsr_lab.experiments.engine.truth import Figures, Truth, lens_ssims
from lfsr_lab.experiments.rivals import lfbm5d
from lfsr_lab.experiments.rivals.lfbm5d import LFDnPatch
from lfsr_lab.experiments.rivals.makers import MAKERS

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
    "deep": ("deep.blend", "unseen"),
}


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
    found = next((path for folder in folders if (path := folder / file).is_file()), None)
    scene = Scene(name, file, group, display=DISPLAY, scale=SCALES[0], lenses=LENSES)
    return Place(store, scene, found) if found else None


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
FOLLOWERS = {7: (*OURS, "AngularSR-1", "AngularSR-2", "Sheared-EPI"), 3: (*OURS, "EPICNN")}
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
    return Row(seconds, {name: _figures(*each, truth, low.scale // 2) for name, each in made.items()})


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
        views = lfbm5d.denoised(lfbm5d.program(clones), _views(low.color))
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
