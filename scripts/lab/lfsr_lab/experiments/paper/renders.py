"""The renders that figures share, made when first asked for.

``BENCH/SCENE/reference``, ``BENCH/SCENE/s{scale}-spp{n}`` and variants of the latter; what is there is used as it is.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

from lfsr_core.arrays import Array
from lfsr_core.files import write_json
from lfsr_core.frames.foreground import foreground_mask
from lfsr_core.frames.frame import FRAME_FILE, LOW_RES_FILE, read_frame
from lfsr_core.frames.job import Job, check_scene
from lfsr_core.images.exr import read_layers
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.lens_sampling import choose_lenses
from lfsr_core.render.blender import find_blender
from lfsr_core.render.store import cached, with_blender
from lfsr_lab.experiments.paper.settings import Settings
from lfsr_lab.scenes import scene_script
from lfsr_lab.scenes.running import run_script

LAYERS = ("albedo", "normal")


@dataclasses.dataclass(frozen=True)
class Shot:
    """One low-resolution render."""

    scene: Path  # its file
    scale: int  # factor, 1 for every view
    spp: int  # samples per pixel
    display: DisplayProfile | None = None  # None for that of accuracy
    layout: str = "one-pass"  # how views are rendered, see ``Job``


def low_resolution(settings: Settings, shot: Shot) -> Path:
    """Frame folder of a render; LfsrError where the folder holds another one."""
    variant = "" if shot.layout == "one-pass" else f"-{shot.layout}"
    job = _job(settings, shot.scene, f"s{shot.scale}-spp{shot.spp}{variant}", shot.display or settings.display)
    return cached(dataclasses.replace(job, scale=shot.scale, spp=shot.spp, layers=LAYERS, layout=shot.layout),
                  with_blender(settings.blender))


def reference(settings: Settings, scene: Path) -> Path:
    """Reference folder of ``scene`` on ``settings.display``; an existing one may have any number of samples."""
    job = dataclasses.replace(_job(settings, scene, "reference", settings.display), kind="reference",
                              spp=settings.reference_spp, clamp_indirect=0.0)
    if settings.lenses is not None and not Path(job.output, FRAME_FILE).exists():
        mask = foreground(low_resolution(settings, Shot(scene, settings.scale, settings.spp)))
        job = dataclasses.replace(job, lens_list=choose_lenses(mask, settings.lenses))
    return cached(job, with_blender(settings.blender))


def _job(settings: Settings, scene: Path, name: str, display: DisplayProfile) -> Job:
    """A job at full resolution in the folder of this name, on ``settings.display`` in the shared bench folder."""
    bench = settings.bench if display == settings.display else settings.output / f"bench-{display.name}"
    convention = "" if settings.convention == "centred" else f"-{settings.convention}"
    return Job(output=str(bench / scene.stem / f"{name}{convention}"), display=display, scene=check_scene(scene),
               scale=1, convention=settings.convention, device=settings.render_device)


def moved(settings: Settings, scene: Path, share: float) -> Path:
    """A copy of ``scene`` whose camera array stands at ``share`` of its distance from the display plane."""
    path = settings.output / "moved" / f"{scene.stem}-{settings.timing_display.name}-{share:g}.blend"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        job = path.with_suffix(".json")
        write_json(job, {"scene": check_scene(scene), "display": settings.timing_display.to_dict(), "share": share,
                         "output": str(path.resolve())})
        run_script(find_blender(settings.blender), scene_script("move_camera_array.py"), job, [path])
    return path


def demo_scene(settings_output: Path) -> Path:
    """The demo scene, built by the script that ships with the repository."""
    path = settings_output / "demo.blend"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        run_script(find_blender(), scene_script("demo_scene.py"), path, [path])
    return path


def resolution(display: DisplayProfile, divisor: int) -> DisplayProfile | None:
    """The same lenses with views and pixels divided, None where they do not divide."""
    if any(count % divisor for count in display.views):
        return None
    views, pixels = (tuple(count // divisor for count in pair) for pair in (display.views, display.panel_pixels))
    return dataclasses.replace(display, name=f"{display.name}-1-{divisor}" if divisor > 1 else display.name,
                               views=views, panel_pixels=pixels)


def foreground(folder: Path) -> Array:
    """(sy, sx) bool: lenses of a render that see the foreground."""
    return foreground_mask(read_layers(folder / LOW_RES_FILE), read_frame(folder).rays.tiles)
