"""Numbers that the panel shows, as (name, text) pairs."""

from __future__ import annotations

import functools
import math
from pathlib import Path

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.progress import duration
from lfsr_core.frames.finish import read_report
from lfsr_core.frames.frame import REPORT_FILE, SUBPIXELS
from lfsr_core.optics.depth_scale import samples_at
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.panel_rays import rendered_size
from lfsr_core.plan.options import PlanOptions

from ..scene import devices, folders, image_before
from ..scene import settings as scene_settings
from ..scene.array import cached, rig
from ..scene.settings import Resolved, length
from ..scene.words import counted

Facts = list[tuple[str, str]]
METRICS = {"ssim_eia_fg": "SSIM Foreground", "ssim_lens_fg": "SSIM per Lens", "ssim_views_fg": "SSIM Views",
           "psnr_fg": "PSNR", "flip": "FLIP", "ssim_eia_plain": "Plain SSIM", "ssim_ceiling": "SSIM Ceiling",
           "ssim_lens_plain": "Plain per Lens", "ssim_lens_ceiling": "Lens Ceiling"}
CAMERAS = {"one-pass": "OSL camera", "lens-card": "lens card", SUBPIXELS: "panel card"}


def display_facts(settings: Resolved) -> Facts:
    """Lenses, views and resolutions; LfsrError if the scale does not divide the views."""
    display = settings.display
    if settings.subpixels:
        (width, height), panel = rendered_size(display), display.panel_pixels
        return [("Rendered", f"{width} × {height} px"), ("Image", f"{panel[0]} × {panel[1]} px")]
    low, lenses, views = display.low_views(settings.sampling.scale), display.lenses, display.views
    more = " or more" if settings.sampling.scales else ""
    return [("Lenses", f"{lenses[0]} × {lenses[1]}"),
            ("Views", f"{views[0]} × {views[1]}"),
            ("Rendered", f"{low[0]} × {low[1]}{more}"),
            ("", f"{lenses[0] * low[0]} × {lenses[1] * low[1]} px{more}"),
            ("Image", f"{display.eia_pixels[0]} × {display.eia_pixels[1]} px")]


def sample_facts(settings: Resolved) -> Facts:
    """Samples that follow from the rays, or rays from fixed samples; of Auto those at its smallest and largest scale.

    LfsrError if the rays are too many.
    """
    display, scales = settings.display, settings.sampling.scales or (settings.sampling.scale,)
    if settings.rays is None:
        rays = [f"{settings.sampling.samples / display.finished_pixels(scale):.3g}" for scale in scales]
        return [("", _up_to(rays[0], rays[-1], "ray") + " per pixel")]
    samples = [f"{samples_at(display, scale, settings.rays)}" for scale in scales]
    return [("", _up_to(samples[-1], samples[0], "sample"))]


def _up_to(least: str, most: str, noun: str) -> str:
    """Two numbers with their noun, as in "4 to 16 samples" or "1 sample"."""
    numbers = " to ".join(dict.fromkeys((least, most)))
    return f"{numbers} {noun}" if numbers == "1" else f"{numbers} {noun}s"


def plan_cost(scene: bpy.types.Scene) -> str:
    """A sentence on what finding the cheapest settings may cost; empty where the settings are wrong."""
    try:
        settings = scene_settings.resolve(scene)
        paths = _most_paths(settings.display, round(scene.lfsr.plan_target, 4))
    except LfsrError:
        return ""  # the panel Display says what is wrong
    state = bpy.context.window_manager.lfsr
    if state.probe_scene == scene.name_full:
        return f"Takes {duration(paths * state.probe_per_path)} at most. A first guess comes at once"
    images = max(1, round(paths / image_before.paths_of(settings)))
    return f"Takes as long as {counted(images, 'image')} at most. A first guess comes at once"


@functools.lru_cache(maxsize=8)
def _most_paths(display: DisplayProfile, target: float) -> float:
    return PlanOptions(target=target).most_paths(display)


def depth_facts(scene: bpy.types.Scene) -> Facts:
    """Width and usable depth of the scene's array; empty where it has none, LfsrError if it is broken."""
    display = scene_settings.display_of(scene)
    placed = cached.placement(scene, display)
    if placed is None:
        return []
    array, (near, far) = placed[0], rig.usable_depth(placed[0], display)
    return [("Width", length(scene, 2 * array.half_width)),
            ("In Front", length(scene, array.distance - near)),
            ("Behind", "unlimited" if math.isinf(far) else length(scene, far - array.distance))]


def device_facts(scene: bpy.types.Scene) -> Facts:
    """Device that renders the scene, and the camera that it uses."""
    device = scene_settings.device_of(scene)
    way = SUBPIXELS if scene_settings.renders_subpixels(scene) else devices.way_of(device)
    return [("Renders On", f"{device}, {CAMERAS[way]}")]


def lacks_gpu(scene: bpy.types.Scene) -> bool:
    """True if the scene asks for a GPU and Blender's preferences have none."""
    return scene.cycles.device != "CPU" and scene_settings.device_of(scene) == "CPU"


def metric_facts(scene: bpy.types.Scene) -> Facts:
    """Metrics in the report of the current frame; empty where there are none."""
    try:
        report = folders.frame_folder(scene) / REPORT_FILE
        return list(_metrics(report.parent, report.stat().st_mtime_ns, folders.source_of(scene), scene.name_full))
    except (LfsrError, OSError):
        return []  # nothing rendered yet


@functools.lru_cache(maxsize=4)
def _metrics(folder: Path, _changed: int, source: str, scene_name: str) -> tuple[tuple[str, str], ...]:
    """Panels ask on every redraw; the file is read once per change."""
    if not folders.holds(folder, source, scene_name):
        return ()
    metrics = read_report(folder).metrics
    facts = [(title, f"{metrics[name]:.1f} dB" if name == "psnr_fg" else f"{metrics[name]:.4f}")
             for name, title in METRICS.items() if isinstance(metrics.get(name), (int, float))]
    without_flip = "flip" in metrics and metrics["flip"] is None
    return (*facts, ("FLIP", "not computed")) if without_flip else tuple(facts)
