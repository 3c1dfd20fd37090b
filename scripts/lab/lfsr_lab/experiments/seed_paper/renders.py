"""The renders that figures share, made when first asked for.

``BENCH/SCENE/reference``, ``BENCH/SCENE/s{scale}-spp{n}`` and variants of the latter; what is there is used as it is.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from lfsr_core.base.files import write_json
from lfsr_core.frames.request import Request, Sampling, check_scene
from lfsr_core.optics.display import DisplayProfile, load_display
from lfsr_core.process.blender import find_blender
from lfsr_lab.experiments.engine.records import StudySettings
from lfsr_lab.experiments.engine.renders import REFERENCE, Store, reference_of
from lfsr_lab.scenes import run_script, scene_script

CELLS = "cells"  # folder of measurements
VERSION = 5  # increase it when a measurement of the same inputs yields other numbers
SCALE = 4  # factor of the low-resolution renders
QUICK_DISPLAY = DisplayProfile("paper-quick", (192, 112), (192.0, 112.0), (12, 7), (16, 16), 250.0, 40.0)


@dataclasses.dataclass(frozen=True)
class Settings(StudySettings):
    output: Path  # folder of everything that is made
    scenes: tuple[Path, ...]  # scene files
    bench: Path  # folder of renders on ``display``, may be shared
    display: DisplayProfile  # for accuracy
    timing_display: DisplayProfile  # for times of whole frames
    spp: int = 16  # samples per pixel that a user renders with
    clean_spp: int = 4096  # samples per pixel nearly free of noise
    reference_spp: int = 1024  # samples per pixel of a reference
    weights: Path | None = None  # folder of trained networks, None for those that ship
    train_epochs: int = 0  # training per missing network, 0 trains none
    photographs: str = ""  # to train with, empty for those of the built-in configs
    device: str = "auto"  # for networks
    render_device: str = "CPU"  # for Cycles
    blender: str | None = None  # executable, None to look for one
    repeats: int = 10  # runs of everything timed but renders
    steps: tuple[int, ...] = (8, 16, 32, 48, 80, 128, 208)  # elemental images per call in Fig. 10(a)
    moves: tuple[float, ...] = (0.3, 0.45, 0.7, 1.0, 1.6)  # distances of the camera array in Fig. 10(b), 1: its own
    resolutions: tuple[int, ...] = (4, 2, 1)  # divisors of ``timing_display`` in Fig. 12(a)
    workload: tuple[int, int] = (5184, 20)  # elemental images and their side where only a network is timed
    quick: bool = False  # whether the run only touches every figure

    def facts(self) -> dict[str, Any]:
        """Return what the page says about the run: no paths."""
        names = ("spp", "clean_spp", "reference_spp", "train_epochs", "repeats", "quick", "render_device")
        return {**{name: getattr(self, name) for name in names}, "display": self.display.name,
                "timing_display": self.timing_display.name, "version": VERSION,
                "scenes": [scene.stem for scene in self.scenes]}


def make_settings(output: Path, quick: bool = False, **changes: Any) -> Settings:
    """Return the settings of a run; ``quick`` touches every figure in minutes, and its numbers mean little."""
    values: dict[str, Any] = {"display": "small", "timing_display": "bupt-32in-8k"}
    if quick:
        values = {"display": QUICK_DISPLAY, "timing_display": QUICK_DISPLAY, "spp": 4, "clean_spp": 64, "repeats": 6,
                  "reference_spp": 32, "steps": (8, 48, 208), "moves": (0.5, 1.0, 2.0), "resolutions": (2, 1),
                  "workload": (416, 20), "quick": True}
    values |= {"output": output, "bench": output / "bench", **changes}
    displays = {name: load_display(value) for name, value in values.items()
                if name in ("display", "timing_display") and isinstance(value, str)}
    return Settings(**values | displays)


@dataclasses.dataclass(frozen=True)
class View:
    scene: Path  # its file
    spp: int  # samples per pixel
    scale: int = SCALE  # factor, 1 for every view
    display: DisplayProfile | None = None  # None for that of accuracy
    layout: str = "one-pass"  # how views are rendered, see ``Job``


def rendered(settings: Settings, view: View) -> Path:
    """Return the frame folder of a render; LfsrError where the folder holds another one."""
    return store(settings).rendered(_job(settings, view))


def reference(settings: Settings, scene: Path) -> Path:
    """Return the reference folder of a scene on ``settings.display``; one that is there may have any samples."""
    job = _job(settings, View(scene, settings.spp))
    return store(settings).rendered(reference_of(job, settings.reference_spp, Path(job.output).with_name(REFERENCE)))


def store(settings: Settings) -> Store:
    return Store(settings.output, settings.blender)


def _job(settings: Settings, view: View) -> Request:
    """Return the job of a render, on ``settings.display`` in the shared folder of renders."""
    display = view.display or settings.display
    bench = settings.bench if display == settings.display else settings.output / f"bench-{display.name}"
    variant = "" if view.layout == "one-pass" else f"-{view.layout}"
    folder = bench / view.scene.stem / f"s{view.scale}-spp{view.spp}{variant}"
    return Request(output=str(folder), display=display, scene=check_scene(view.scene),
                   sampling=Sampling(view.scale, view.spp), layout=view.layout, device=settings.render_device)


def moved(settings: Settings, scene: Path, fraction: float) -> Path:
    """Return a copy of ``scene`` whose camera array stands at a fraction of its distance from the display plane."""
    path = settings.output / "moved" / f"{scene.stem}-{settings.timing_display.name}-{fraction:g}.blend"
    if not path.exists():
        job = path.with_suffix(".json")
        write_json(job, {"scene": check_scene(scene), "display": settings.timing_display.to_dict(), "share": fraction,
                         "output": str(path.resolve())})
        run_script(find_blender(settings.blender), scene_script("move_camera_array.py"), job, [path])
    return path


def demo_scene(output: Path, blender: str | None) -> Path:
    """Return the demo scene, built by the script that ships with the repository."""
    path = output / "demo.blend"
    if not path.exists():
        output.mkdir(parents=True, exist_ok=True)
        run_script(find_blender(blender), scene_script("demo_scene.py"), path, [path])
    return path


def resolution(display: DisplayProfile, divisor: int) -> DisplayProfile | None:
    """Return a display of the same lenses with views and pixels divided, None where they do not divide."""
    if any(count % divisor for count in display.views):
        return None
    (px, py), (width, height) = display.views, display.panel_pixels
    return dataclasses.replace(display, name=f"{display.name}-1-{divisor}" if divisor > 1 else display.name,
                               views=(px // divisor, py // divisor), panel_pixels=(width // divisor, height // divisor))
