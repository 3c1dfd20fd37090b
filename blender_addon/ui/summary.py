"""Numbers that the panel shows, as (name, text) pairs."""

from __future__ import annotations

import functools
import math
from pathlib import Path

import bpy

from lfsr_core.errors import LfsrError
from lfsr_core.frames.frame import REPORT_FILE
from lfsr_core.frames.report import read_report
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.panel_rays import rendered_size

from ..array import rig
from ..render import devices
from ..settings import scene_settings
from ..settings.scene_settings import length

Facts = list[tuple[str, str]]
METRICS = {"ssim_eia_fg": "SSIM, foreground", "ssim_lens_fg": "SSIM, lens by lens", "ssim_views_fg": "SSIM, views",
           "psnr_fg": "PSNR", "flip": "FLIP", "ssim_eia_plain": "Plain SSIM", "ssim_ceiling": "Its ceiling",
           "ssim_lens_plain": "Plain, lens by lens", "ssim_lens_ceiling": "Its ceiling"}
WAYS = {"one-pass": "by the OSL camera", "lens-card": "through the lens card"}
IN_DECIBEL = ("psnr_fg",)


def display_facts(display: DisplayProfile, scale: int) -> Facts:
    """Lenses, views and resolutions of a display at a scale; LfsrError if the scale does not divide the views."""
    low = display.low_views(scale)
    lenses, views = display.lenses, display.views
    return [("Lenses", f"{lenses[0]} × {lenses[1]}"),
            ("Views", f"{views[0]} × {views[1]}"),
            ("Rendered", f"{low[0]} × {low[1]}"),
            ("", f"{lenses[0] * low[0]} × {lenses[1] * low[1]} px"),
            ("Image", f"{display.eia_pixels[0]} × {display.eia_pixels[1]} px")]


def panel_facts(display: DisplayProfile) -> Facts:
    """Resolutions where the subpixels of a display with a lens sheet are rendered."""
    sizes = {"Rendered": rendered_size(display), "Image": display.panel_pixels}
    return [(name, f"{width} × {height} px") for name, (width, height) in sizes.items()]


def depth_facts(scene: bpy.types.Scene) -> Facts:
    """Sizes and usable depth of the scene's array; LfsrError if it or the display is broken."""
    display = scene_settings.display_of(scene)
    array, _ = rig.placement(scene, display)
    near, far = rig.usable_depth(array, display)
    return [("Width", length(scene, 2 * array.half_width)),
            ("In Front", length(scene, array.distance - near)),
            ("Behind", "unlimited" if math.isinf(far) else length(scene, far - array.distance))]


def device_facts(scene: bpy.types.Scene) -> Facts:
    """What the scene renders on, and what sends the rays there."""
    device = scene_settings.device_of(scene)
    if device == "CPU" and scene.cycles.device != "CPU":
        return [("Renders on", "the CPU, no GPU is set up in Preferences > System")]
    return [("Renders on", f"{device}, {WAYS[devices.way_of(device)]}")]


def metric_facts(scene: bpy.types.Scene) -> Facts:
    """Metrics in the report of the current frame; empty where there are none."""
    try:
        report = scene_settings.frame_folder(scene) / REPORT_FILE
        return list(_metrics(report.parent, report.stat().st_mtime_ns))
    except (LfsrError, OSError):
        return []  # nothing rendered yet


@functools.lru_cache(maxsize=4)
def _metrics(folder: Path, _changed: int) -> tuple[tuple[str, str], ...]:
    """Panels ask on every redraw; the file is read once per change."""
    metrics = read_report(folder).metrics
    facts = [(title, f"{metrics[name]:.1f} dB" if name in IN_DECIBEL else f"{metrics[name]:.4f}")
             for name, title in METRICS.items() if isinstance(metrics.get(name), (int, float))]
    without_flip = "flip" in metrics and metrics["flip"] is None
    return (*facts, ("FLIP", "not computed")) if without_flip else tuple(facts)
