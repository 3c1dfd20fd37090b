"""The renders that figures share, made when first asked for.

``BENCH/SCENE/reference``, ``BENCH/SCENE/s{scale}-spp{n}`` and variants of the latter; what is there is used as it is.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

from lfsr_core.base.files import write_json
from lfsr_core.frames.request import Request, Sampling, check_scene
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.process.blender import find_blender
from lfsr_lab.experiments.engine.renders import REFERENCE, Store, reference_of
from lfsr_lab.experiments.seed_paper.settings import SCALE, Settings
from lfsr_lab.scenes import scene_script
from lfsr_lab.scenes.running import run_script


@dataclasses.dataclass(frozen=True)
class View:
    """One render."""

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
    """Return the store that makes missing renders."""
    return Store(settings.output, settings.blender)


def _job(settings: Settings, view: View) -> Request:
    """Return the job of a render, on ``settings.display`` in the shared folder of renders."""
    display = view.display or settings.display
    bench = settings.bench if display == settings.display else settings.output / f"bench-{display.name}"
    variant = "" if view.layout == "one-pass" else f"-{view.layout}"
    folder = bench / view.scene.stem / f"s{view.scale}-spp{view.spp}{variant}"
    return Request(output=str(folder), display=display, scene=check_scene(view.scene), sampling=Sampling(view.scale,
            view.spp),
               layout=view.layout, device=settings.render_device)


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
                               views=(px // divisor, py // divisor),
                               panel_pixels=(width // divisor, height // divisor))
