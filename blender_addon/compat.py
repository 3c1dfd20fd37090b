"""The Blender that this runs in: its version, what it was built with, its devices; changes for one render.

Versions are 4.5, 5.0, 5.2 and 5.3; no other module asks for them.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

import bpy

from lfsr_core.base.messages import LfsrError
from lfsr_core.frames.frame import AUTO

# The fastest first: "auto" is the first that this machine has.
GPU_TYPES = ("OPTIX", "CUDA", "HIP", "ONEAPI", "METAL")
WITH_OSL_CAMERA = ("CPU", "OPTIX")
ADDRESS = re.compile(r"[0-9a-f]{4}:[0-9a-f]{2}:[0-9a-f]{2}")


@contextmanager
def overridden(owner: Any, values: Mapping[str, Any]) -> Iterator[None]:
    """Set properties of ``owner`` inside the block and restore them after it, also after an error.

    List a property after those it depends on (a bit depth after its file format): all are recorded before
    the first is set, and they are set and restored in the given order. A value of an older file that this Blender does
    not have cannot be restored. AttributeError for a name that this Blender does not have.
    """
    before = {name: copied(getattr(owner, name)) for name in values}
    try:
        assign(owner, values)
        yield
    finally:
        for name, value in before.items():
            with suppress(TypeError):
                assign(owner, {name: value})


@contextmanager
def new_data() -> Iterator[list[bpy.types.ID]]:
    """Yield a list of new data, which is removed from the file after the block."""
    made: list[bpy.types.ID] = []
    try:
        yield made
    finally:
        bpy.data.batch_remove(made)


def assign(owner: Any, values: Mapping[str, Any]) -> None:
    """Set properties of ``owner``, in the given order."""
    for name, value in values.items():
        # Setting an equal value would tag the data for an update.
        if copied(getattr(owner, name)) != value:
            setattr(owner, name, value)


def copied(value: Any) -> Any:
    """Return a copy of an array property, which would change with the data; another value as it is."""
    return tuple(value) if hasattr(value, "__len__") and not isinstance(value, (str, set)) else value


@contextmanager
def wait_cursor() -> Iterator[None]:
    """Show in every window that Blender is busy inside the block; background mode has none."""
    windows = [] if bpy.app.background else list(bpy.context.window_manager.windows)
    for window in windows:
        window.cursor_modal_set("WAIT")
    try:
        yield
    finally:
        for window in windows:
            window.cursor_modal_restore()


def has_osl() -> bool:
    """Return True if this Blender was built with Open Shading Language; Debian's is not."""
    return _built_with("with_osl")


def has_denoiser() -> bool:
    """Return True if this Blender was built with Open Image Denoise."""
    return _built_with("with_openimagedenoise")


def _built_with(feature: str) -> bool:
    try:
        import _cycles
    except ImportError:
        return False
    return bool(getattr(_cycles, feature))


def way_of(device: str) -> str:
    """Return the faster layout that renders all views in one pass on ``device`` (docs/reference/devices.md).

    Cycles runs OSL cameras on the CPU and OptiX only, in a Blender with OSL.
    """
    return "one-pass" if device in WITH_OSL_CAMERA and has_osl() else "lens-card"


def best_device(device: str) -> str:
    """Return ``device`` itself, or for "auto" the best device of this machine."""
    return device if device != AUTO else next(
        (kind for kind in GPU_TYPES if any(item.type == kind for item in _devices(kind))), "CPU")


def _devices(kind: str) -> Sequence[bpy.types.bpy_struct]:
    """Devices of a type on this machine; none for a type that this Blender does not know."""
    preferences = cycles_preferences()
    kinds = {item[0] for item in preferences.get_device_types(bpy.context)}
    return preferences.get_devices_for_type(kind) if kind in kinds else ()


@contextmanager
def device_enabled(device: str) -> Iterator[None]:
    """Let Cycles use all devices of the type ``device`` inside the block; LfsrError if there is none."""
    if device == "CPU":
        yield
        return
    preferences = cycles_preferences()
    kinds = [item[0] for item in preferences.get_device_types(bpy.context) if item[0] != "NONE"]
    if device not in kinds:
        raise LfsrError(f"device is {device!r}, but this Blender knows only {', '.join(['CPU', *kinds])}: "
                        "choose one of them")
    with overridden(preferences, {"compute_device_type": device}), ExitStack() as stack:
        preferences.refresh_devices()
        if all(item.type != device for item in preferences.devices):
            raise LfsrError(f"device is {device!r}, but this machine has none that Blender can use: "
                            "render on the CPU or check the driver")
        for item in preferences.devices:
            stack.enter_context(overridden(item, {"use": item.type == device}))
        yield


def gpu_addresses(device: str) -> tuple[str, ...]:
    """Return the PCI addresses, as "0000:65:00", of the devices of the GPU type ``device``; () for the CPU.

    Cycles writes them into the ids of its devices, except of Metal's.
    """
    return tuple(dict.fromkeys(match[0] for item in _devices(device) if (match := ADDRESS.search(item.id))))


def cycles_preferences() -> bpy.types.AddonPreferences:
    """Return the preferences of Cycles; LfsrError if its add-on is switched off."""
    if (addon := bpy.context.preferences.addons.get("cycles")) is None:
        raise LfsrError("Cycles is switched off in Blender's preferences: switch the Cycles Render Engine add-on on")
    return addon.preferences


def _has(owner: Any, name: str) -> bool:
    """True if this Blender's type ``owner`` has the property ``name``."""
    return name in owner.bl_rna.properties


def _media(kind: str) -> dict[str, Any]:
    """Kind of media that must be set before a file format, since 5.0."""
    return {"media_type": kind} if _has(bpy.types.ImageFormatSettings, "media_type") else {}


def multilayer_exr(half: bool = False) -> dict[str, Any]:
    """Return image settings for a multi-layer EXR of 32-bit (or 16-bit) floats, in the order they must be set."""
    return _media("MULTI_LAYER_IMAGE") | {
        "file_format": "OPEN_EXR_MULTILAYER", "color_mode": "RGBA", "color_depth": "16" if half else "32",
        "exr_codec": "ZIP", "color_management": "FOLLOW_SCENE"}


def video_output() -> dict[str, Any]:
    """Return image settings for a film, in the order they must be set."""
    return _media("VIDEO") | {"file_format": "FFMPEG", "color_mode": "RGB"}


def working_space() -> str:
    """Return the name of the file's linear colour space, which can be chosen since 5.0."""
    return bpy.data.colorspace.working_space if hasattr(bpy.data, "colorspace") else "Linear Rec.709"


def compositor(scene: bpy.types.Scene) -> bpy.types.NodeTree | None:
    """Return the nodes that Blender would apply to a render of ``scene``; since 5.0 they are a node group."""
    if not scene.render.use_compositing:
        return None
    if _has(bpy.types.Scene, "compositing_node_group"):
        return scene.compositing_node_group
    return scene.node_tree if scene.use_nodes else None


def literal_path(path: str) -> str:
    """Return ``path`` for a render's output: since 4.5 single braces there are templates."""
    return path.replace("{", "{{").replace("}", "}}")


def use_nodes(owner: bpy.types.Material | bpy.types.World) -> None:
    """Give a new material or world its node tree; since 5.0 it has one from the start."""
    if owner.node_tree is None:
        owner.use_nodes = True


def known(owner: Any, **values: Any) -> dict[str, Any]:
    """Return those of the settings ``values`` that ``owner`` has in this Blender."""
    return {name: value for name, value in values.items() if hasattr(owner, name)}


def path_from_camera() -> bool:
    """Return True if a perspective camera's paths begin at the camera, not where its clip starts: since 5.3."""
    return bpy.app.version >= (5, 3, 0)


def whole_textures() -> dict[str, Any]:
    """Return render settings without 5.2's texture cache, which blurs what is seen through a lens."""
    return {"use_texture_cache": False} if _has(bpy.types.RenderSettings, "use_texture_cache") else {}
