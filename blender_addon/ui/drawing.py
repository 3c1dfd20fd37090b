"""What panels share: labels beside values, sentences over several lines, and the numbers that they show."""

import functools
import math
import textwrap
from pathlib import Path

import bpy

from lfsr_core.base.messages import LfsrError, duration
from lfsr_core.frames.folder import FrameFolder, is_of
from lfsr_core.frames.frame import REPORT_FILE, SUBPIXELS, read_report, samples_at
from lfsr_core.optics.display import DisplayProfile
from lfsr_core.optics.panel.subpixel_rays import rendered_size
from lfsr_core.plan.options import PlanOptions

from ..jobs import folders
from ..scene import settings as scene_settings
from ..scene.array import rig
from ..scene.settings import Resolved, length
from ..scene.words import counted, for_panel

PIXELS_PER_LETTER = 6.6
Facts = list[tuple[str, str]]
METRICS = {"ssim_eia_fg": "SSIM Foreground", "ssim_lens_fg": "SSIM per Lens", "ssim_views_fg": "SSIM Views",
           "psnr_fg": "PSNR", "flip": "FLIP", "ssim_eia_plain": "Plain SSIM", "ssim_ceiling": "SSIM Ceiling",
           "ssim_lens_plain": "Plain per Lens", "ssim_lens_ceiling": "Lens Ceiling"}
CAMERAS = {"one-pass": "OSL camera", "lens-card": "lens card", SUBPIXELS: "panel card"}


class LightFieldPanel:
    """Base of every panel of the tab, closed at first."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Light Field"
    bl_options = {"DEFAULT_CLOSED"}


def columns(layout: bpy.types.UILayout) -> bpy.types.UILayout:
    """Column with labels left and values right, as in Blender's own panels."""
    column = layout.column()
    column.use_property_split = True
    column.use_property_decorate = False
    return column


def row_if(applies: bool, layout: bpy.types.UILayout) -> bpy.types.UILayout:
    """Row for a setting, greyed out where it is not used."""
    row = layout.row()
    row.enabled = applies
    return row


def facts(layout: bpy.types.UILayout, pairs: Facts, factor: float = 0.4) -> None:
    """Draw names left and values right; the names take ``factor`` of the width."""
    column = layout.column(align=True)
    column.scale_y = 0.8
    for name, value in pairs:
        split = column.split(factor=factor)
        left = split.row()
        left.alignment = "RIGHT"
        left.label(text=name)
        split.label(text=value)


def sentence(layout: bpy.types.UILayout, text: str, icon: str, context: bpy.types.Context,
             width: int | None = None) -> None:
    """Draw a text, broken into lines that fit ``width`` units of the interface, by default the sidebar."""
    # Without a window the interface has no scale.
    scale = context.preferences.system.ui_scale or 1.0
    pixels = width * scale if width else context.region.width if context.region else 300
    letters = max(20, int(pixels / (scale * PIXELS_PER_LETTER)) - 6)
    column = layout.column(align=True)
    column.scale_y = 0.75
    for number, line in enumerate(textwrap.wrap(for_panel(text), letters)):
        column.label(text=line, icon=icon if number == 0 else ("BLANK1" if icon != "NONE" else "NONE"))


def image_text(scene: bpy.types.Scene) -> str:
    """Return how many points an eye will see, and how long the image takes; LfsrError where the settings are wrong."""
    settings = scene_settings.check(scene)
    width, height = settings.display.panel_pixels if settings.subpixels else settings.display.lenses
    text, expected = f"{width} × {height} points", folders.expected_seconds(scene)
    return text if expected is None else f"{text}, about {duration(expected)}"


def display_facts(settings: Resolved) -> Facts:
    """Lenses, views, resolutions, samples and device; for scale Auto, ranges from its largest to its smallest scale.

    LfsrError if the scale does not divide the views, or the rays are too many.
    """
    display, sampling, way = settings.display, settings.sampling, settings.request.layout
    scales, panel = sampling.scales or (sampling.scale,), display.panel_pixels
    if settings.subpixels:
        width, height = rendered_size(display)
        facts = [("Rendered", f"{width} × {height} px")]
    else:
        low, lenses, views = display.low_views(sampling.scale), display.lenses, display.views
        more = " or more" if sampling.scales else ""
        facts = [("Lenses", f"{lenses[0]} × {lenses[1]}"), ("Views", f"{views[0]} × {views[1]}"),
                 ("Rendered", f"{low[0]} × {low[1]}{more}"),
                 ("", f"{lenses[0] * low[0]} × {lenses[1] * low[1]} px{more}")]
    if settings.rays is None:
        counts = [f"{sampling.samples / display.finished_pixels(scale):.3g}" for scale in scales]
        rays = _up_to(counts[0], counts[-1], "ray") + " per pixel"
    else:
        counts = [f"{samples_at(display, scale, settings.rays)}" for scale in scales]
        rays = _up_to(counts[-1], counts[0], "sample")
    return [*facts, ("", rays), ("Panel", f"{panel[0]} × {panel[1]} px"),
            ("Renders On", f"{settings.request.device}, {CAMERAS[way]}")]


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
        return f"Takes {duration(paths * state.probe_per_path)} at most"
    display, sampling = settings.display, settings.sampling
    rays = sampling.samples / display.finished_pixels(sampling.scale) if settings.rays is None else settings.rays
    return f"Takes as long as {counted(max(1, round(paths / (math.prod(display.eia_pixels) * rays))), 'image')} at most"


@functools.lru_cache(maxsize=8)
def _most_paths(display: DisplayProfile, target: float) -> float:
    return PlanOptions(target=target).most_paths(display)


def depth_facts(scene: bpy.types.Scene) -> Facts:
    """Width and usable depth of the scene's array; empty where it has none, LfsrError if it is broken."""
    display = scene_settings.display_of(scene)
    if (placed := rig.placed(*rig.drawn(scene), display)) is None:
        return []
    array, (near, far) = placed[0], rig.usable_depth(placed[0], display)
    return [("Width", length(scene, 2 * array.half_width)), ("In Front", length(scene, array.distance - near)),
            ("Behind", "unlimited" if math.isinf(far) else length(scene, far - array.distance))]


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
    if not is_of(FrameFolder(folder).readable, source, scene_name):
        return ()
    metrics = read_report(folder).metrics
    return tuple((title, f"{metrics[name]:.1f} dB" if name == "psnr_fg" else f"{metrics[name]:.4f}")
                 for name, title in METRICS.items() if isinstance(metrics.get(name), (int, float)))
