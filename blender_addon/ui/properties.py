"""Settings of a scene, which are saved with it, the add-on's preferences, and what the panel knows in this session."""

from __future__ import annotations

import typing
import zlib

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from lfsr_core.frames.frame import MOST_AVERAGED
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, MENU, MORE

from ..jobs import images, runtime
from ..scene.array import rig
from ..scene.light import AUTO_LIGHT, light_items
from ..scene.settings import AUTO_SCALE, DEFAULT_DISPLAY, SCALES, offered_scales, profile_items, qualities
from ..scene.words import DIRECT
from .drawing import columns

LIVE_SCALES = (1, 2, 4, 8)  # pixel sizes of Blender's viewport


def _draws(_settings: SceneSettings, _context: bpy.types.Context) -> None:
    """Redraw the 3D views: the frustum depends on the setting."""
    images.redraw("VIEW_3D")


def _display_changed(settings: SceneSettings, context: bpy.types.Context) -> None:
    """Set the preset again: its rays and its method depend on the display. A scale that it lacks becomes Auto."""
    _apply_quality(settings, context)
    if settings.scale not in offered_scales(settings.id_data):
        settings.scale = AUTO_SCALE
    forget_message()
    images.redraw("VIEW_3D")


def forget_message() -> None:
    """Remove the messages about the last image, because the display or its place has changed."""
    state = bpy.context.window_manager.lfsr
    state.message = state.outcome = state.outcome_folder = state.plan_scene = ""


def _apply_quality(settings: SceneSettings, _context: bpy.types.Context) -> None:
    values = qualities(settings.id_data).get(settings.quality)
    if values is None or settings.applying:
        return
    settings.applying = True
    try:
        settings.rays, settings.samples, settings.method = values
    finally:
        settings.applying = False


def _is_custom(settings: SceneSettings, _context: bpy.types.Context) -> None:
    if not settings.applying:
        chosen = settings.rays, settings.samples, settings.method
        settings.quality = next((name for name, values in qualities(settings.id_data).items() if values == chosen),
                                "CUSTOM")


def _show_view(settings: SceneSettings, _context: bpy.types.Context) -> None:
    images.show(settings.id_data, (settings.eye_right, settings.eye_up))


# Named functions: Blender 5.2 loses a lambda that is written inside an annotation.
def _get_distance(settings: SceneSettings) -> float:
    return rig.distance_to(rig.drawn(settings.id_data)[1])


def _set_distance(settings: SceneSettings, distance: float) -> None:
    rig.set_distance(settings.id_data, distance)
    forget_message()


def _get_spacing(settings: SceneSettings) -> float:
    return rig.spacing_of(rig.drawn(settings.id_data)[0])


def _set_spacing(settings: SceneSettings, spacing: float) -> None:
    rig.set_spacing(settings.id_data, spacing)
    forget_message()


def method_items() -> list[tuple[str, str, str, str, int]]:
    """Enum items; each has a number of its own, so that new methods do not change saved scenes."""
    items = [(name, title, text, "NONE", zlib.crc32(name.encode()) & 0x7FFFFFFF)
             for name, (title, text) in (MENU | MORE).items()]
    return [*items[:len(MENU)], ("", "More", "", "NONE", 0), *items[len(MENU):]]


class LfsrPreferences(bpy.types.AddonPreferences):
    """Settings for all files"""

    bl_idname = runtime.PACKAGE

    oidn_path: StringProperty(
        name="Open Image Denoise", subtype="FILE_PATH",
        description="Library that denoises, such as libOpenImageDenoise.so.2 of a download from openimagedenoise.org; "
                    "empty for Blender's own")

    free_cores: IntProperty(
        name="Free Cores", default=1, min=0, soft_max=8,
        description="Processor cores that renders and the second stage leave to Blender and other programs")

    without_denoiser: BoolProperty(
        name="Render Without Denoiser",
        description="Give new scenes a method that a Blender without Open Image Denoise can run, instead of asking; "
                    "the answer to that question sets it")

    seconds_per_path: FloatProperty(
        name="Time per Path", default=0.0, min=0.0, precision=8, options={"HIDDEN"},
        description="Seconds of a path sample on this machine, measured with the last image; 0 before the first")

    def draw(self, _context: bpy.types.Context) -> None:
        column = columns(self.layout)
        for name in ("free_cores", "oidn_path", "without_denoiser"):
            column.prop(self, name)


class SceneSettings(bpy.types.PropertyGroup):
    """Light-field settings of one scene."""

    display: EnumProperty(
        name="Display", description="Light-field display that will show the image",
        items=profile_items(), default=DEFAULT_DISPLAY, update=_display_changed)
    profile_file: StringProperty(
        name="Profile", description="Display profile (.toml) of a display that is not built in",
        subtype="FILE_PATH", options={"PATH_SUPPORTS_BLEND_RELATIVE"}, update=_display_changed)
    subpixels: BoolProperty(
        name=DIRECT, description="Render the panel's own image, one ray direction per subpixel, instead of a light "
        "field. It is more accurate and needs a quarter of the samples, but has no views to preview, compare or "
        "export. Scale, Method, Linear EXR and Temporal Averaging are not used", default=False, update=_display_changed)
    scale: EnumProperty(
        name="Scale", description="Render one of this many views in each direction and reconstruct the others",
        items=[(AUTO_SCALE, "Auto", "The scale that loses least for the subject's depth and the rays", 0),
               *((f"{s}", f"{s}×", f"Render 1 of {s}×{s} views" if s > 1 else "Render every view", s) for s in SCALES)],
        default=AUTO_SCALE, update=_draws)

    distance: FloatProperty(
        name="Distance", description="Distance from the viewing position to the display plane, where objects have no "
        "parallax", subtype="DISTANCE", unit="LENGTH", min=1e-4, soft_min=0.01, soft_max=100.0,
        get=_get_distance, set=_set_distance)
    spacing: FloatProperty(
        name="Array Spacing", description="Spacing of the cameras as a fraction of the one that fills the display's "
        "viewing angle. Less of it flattens the scene and makes more depth usable",
        subtype="FACTOR", min=0.01, max=2.0, soft_max=1.0, precision=2, get=_get_spacing, set=_set_spacing)
    show_frustum: BoolProperty(
        name="Show Frustum", description="Draw the display rectangle, the frustum and the limits of usable depth "
        "in the 3D views", default=True, update=_draws)

    quality: EnumProperty(
        name="Quality", description="How much time to spend on an image",
        items=[("DRAFT", "Draft", "Fewest rays: for placing objects and light"),
               ("BALANCED", "Balanced", "Few rays, denoised: for most images"),
               ("FINAL", "Final", "Many rays, denoised: for final images"),
               ("CUSTOM", "Custom", "Rays and method are set by hand")], default="BALANCED", update=_apply_quality)
    rays: FloatProperty(
        name="Rays per Pixel", description="Paths per pixel of the finished image, which decide noise and time: 1 is "
        "16 samples per rendered pixel at scale 4×, 4 at 2×", min=0.01, soft_max=64.0, precision=2, step=25,
        default=1.0, update=_is_custom)
    samples: IntProperty(
        name="Fixed Samples", description="Paths per rendered pixel, whatever the scale; 0 for those that follow from "
        "Rays per Pixel", min=0, soft_max=1024, default=0, update=_is_custom)
    method: EnumProperty(
        name="Method", description="How the image is denoised and the missing views are made", items=method_items(),
        default=DEFAULT_METHOD, update=_is_custom)
    light: EnumProperty(
        name="Light", description="What lights the scene in light-field renders; the scene itself stays as it is",
        items=light_items(), default=AUTO_LIGHT)
    light_strength: FloatProperty(
        name="Strength", description="Factor of the world image's strength", min=0.01, max=100, soft_max=8, default=1)
    light_file: StringProperty(
        name="Light File", description="World image (.hdr or .exr) that lights the scene",
        subtype="FILE_PATH", options={"PATH_SUPPORTS_BLEND_RELATIVE"})
    seed: IntProperty(name="Seed", description="Seed of the noise: another value renders other noise", min=0, default=0)
    output: StringProperty(
        name="Output", description="Folder for the images of this scene; // is the folder of the .blend file",
        subtype="DIR_PATH", options={"PATH_SUPPORTS_BLEND_RELATIVE"}, default="//lightfield/")
    use_overwrite: BoolProperty(
        name="Overwrite", description="Also render frames of an animation that are complete, and overwrite images of "
        "other files without a question", default=False)
    temporal_averaging: IntProperty(
        name="Temporal Averaging", description="Number of frames before and after each frame of an animation that are "
        "averaged with it against noise, where nothing has changed; 0 for none, 2 is a good value. Frames are not "
        "averaged while the camera array moves", min=0, max=MOST_AVERAGED, default=0)
    linear_exr: BoolProperty(
        name="Linear EXR", description="Also save the scene-linear image, before the view transform, as OpenEXR")

    plan_target: FloatProperty(
        name="Target", description="Accuracy to reach: SSIM over the foreground, 1 is perfect",
        min=0.5, max=0.999, soft_min=0.8, precision=3, step=1, default=0.95)

    reference_samples: IntProperty(
        name="Samples", description="Paths per pixel of the reference, half of them in each of its two images",
        min=2, soft_max=4096, default=256)
    reference_lenses: IntProperty(
        name="Lenses", description="Number of random lenses that are rendered of the reference; 0 for all",
        min=0, soft_max=256, default=16)

    eye_right: FloatProperty(
        name="Eye Right", description="Position of the eye in the viewing zone, from its left (-1) to its right (1)",
        subtype="FACTOR", min=-1.0, max=1.0, step=10, update=_show_view, options={"SKIP_SAVE"})
    eye_up: FloatProperty(
        name="Eye Up", description="Position of the eye in the viewing zone, from its bottom (-1) to its top (1)",
        subtype="FACTOR", min=-1.0, max=1.0, step=10, update=_show_view, options={"SKIP_SAVE"})

    live_scale: EnumProperty(
        name="Pixel Size", description="Scale of the live view: one of this many views in each direction is rendered",
        items=[(f"{s}", f"{s}×", f"Render 1 of {s}×{s} views" if s > 1 else "Render every view", s)
               for s in LIVE_SCALES], default="4")
    live_rays: FloatProperty(
        name="Rays per Pixel", description="Paths per pixel of the display after which the live view stops rendering; "
        "0 for no limit", min=0.0, soft_max=256.0, precision=2, step=100, default=16.0)
    live_samples: IntProperty(
        name="Fixed Samples", description="Paths per rendered pixel after which the live view stops rendering, "
        "whatever the pixel size; 0 for those that follow from Rays per Pixel", min=0, soft_max=4096, default=0)
    live_smooth: BoolProperty(
        name="Interpolate", description="Interpolate the views between the rendered ones, inside each elemental image",
        default=True)
    live_denoise: BoolProperty(
        name="Denoise", description="Denoise the rendered views with Cycles' viewport denoiser", default=True)
    live_eye_right: FloatProperty(
        name="Eye Right", description="Position of the eye; the viewing zone is from -1, its left, to 1, its right",
        min=-4.0, max=4.0, soft_min=-1.0, soft_max=1.0, step=10)
    live_eye_up: FloatProperty(
        name="Up", description="Position of the eye; the viewing zone is from -1, its bottom, to 1, its top",
        min=-4.0, max=4.0, soft_min=-1.0, soft_max=1.0, step=10)
    live_eye_near: FloatProperty(
        name="Distance", description="Distance of the eye as a fraction of the display's viewing distance",
        min=0.1, max=10.0, soft_min=0.5, soft_max=2.0, step=10, default=1.0)

    applying: BoolProperty(name="Applying", description="A preset is being applied", options={"HIDDEN", "SKIP_SAVE"})


# All frames have one value, so Blender must not offer keyframes; but the live view may follow an eye that moves.
SceneSettings.__annotations__ = typing.get_type_hints(SceneSettings)
for name, setting in SceneSettings.__annotations__.items():
    if not name.startswith("live_"):
        setting.keywords["options"] = setting.keywords.get("options", set()) - {"ANIMATABLE"}


def register() -> None:
    """Attach the settings to scenes and the state to the window manager."""
    bpy.types.Scene.lfsr = PointerProperty(
        name="Light Field", description="Light-field settings of this scene", type=SceneSettings)
    bpy.types.WindowManager.lfsr = PointerProperty(
        name="Light Field", description="State of the light-field panel", type=SessionState)


def unregister() -> None:
    """Remove them again; saved files keep their values."""
    del bpy.types.WindowManager.lfsr
    del bpy.types.Scene.lfsr


class SessionState(bpy.types.PropertyGroup):
    """State of the panel in this session."""

    show_problems: BoolProperty(name="Show Checks", description="Show what the last scene check found")
    all_problems: BoolProperty(name="Show All", description="Also show the problems after the first five")
    show_names: BoolProperty(name="Show Names", description="Show each thing that has a problem")
    checked_scene: StringProperty(name="Checked Scene", description="Scene that was checked last")
    message: StringProperty(name="Message", description="Why the last render ended, or what it left out")
    message_is_error: BoolProperty(name="Message Is Error", description="The message says what went wrong")
    outcome: StringProperty(name="Outcome", description="What the last task has done, and in which time")
    outcome_folder: StringProperty(name="Outcome Folder", description="Folder that the last task has written to")
    probe_scene: StringProperty(name="Measured Scene", description="Scene whose time was measured last")
    probe_fixed: FloatProperty(name="Fixed Time", description="Seconds before the first sample of an image")
    probe_per_path: FloatProperty(name="Time per Path", description="Seconds of a path sample", precision=6)
    probe_scale: IntProperty(name="Measured Scale", description="Scale at which the time was measured")
    plan_scene: StringProperty(name="Planned Scene", description="Scene that the last plan is for")
    plan_text: StringProperty(name="Plan", description="What the last plan found")
    plan_scale: IntProperty(name="Planned Scale", description="Scale that the last plan found")
    plan_samples: IntProperty(name="Planned Samples", description="Samples that the last plan found")
    plan_method: StringProperty(name="Planned Method", description="Method that the last plan found, if any")


CLASSES = (LfsrPreferences, SceneSettings, SessionState)
