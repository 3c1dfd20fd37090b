"""Which device Cycles uses, and what sends the rays there."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager

import bpy

from lfsr_core.errors import LfsrError
from lfsr_core.frames.job import AUTO

from .overrides import overridden

# The fastest first; "auto" takes the first that this machine has.
GPU_TYPES = ("OPTIX", "CUDA", "HIP", "ONEAPI", "METAL")
WITH_OSL_CAMERA = ("CPU", "OPTIX")


def has_osl() -> bool:
    """True if this Blender was built with Open Shading Language; Debian's is not."""
    try:
        import _cycles
    except ImportError:
        return False
    return bool(_cycles.with_osl)


def has_denoiser() -> bool:
    """True if this Blender was built with Open Image Denoise."""
    try:
        import _cycles
    except ImportError:
        return False
    return bool(_cycles.with_openimagedenoise)


def has_osl_camera(device: str) -> bool:
    """True if Cycles runs OSL cameras on ``device``: with OSL the CPU and OptiX do, nothing else does."""
    return device in WITH_OSL_CAMERA and has_osl()


def way_of(device: str) -> str:
    """The quicker of the layouts that trace all views in one pass on ``device`` (docs/reference/devices.md)."""
    return "one-pass" if has_osl_camera(device) else "lens-card"


def resolved(device: str, able: Collection[str] = GPU_TYPES) -> str:
    """The device that ``device`` stands for: "auto" is the best of this machine, everything else itself.

    ``able``: GPU types to choose from.
    """
    return device if device != AUTO else next((kind for kind in GPU_TYPES if kind in able and _found(kind)), "CPU")


def _found(kind: str) -> bool:
    preferences = _preferences()
    known = {item[0] for item in preferences.get_device_types(bpy.context)}
    return kind in known and any(item.type == kind for item in preferences.get_devices_for_type(kind))


@contextmanager
def enabled(device: str) -> Iterator[None]:
    """Inside the block Cycles' GPU device type is ``device`` and all its devices are on."""
    if device == "CPU":
        yield
        return
    preferences = _preferences()
    known = [item[0] for item in preferences.get_device_types(bpy.context) if item[0] != "NONE"]
    if device not in known:
        raise LfsrError(f"device is {device!r}, but this Blender knows only {', '.join(['CPU', *known])}: "
                        "choose one of them")
    with overridden(preferences, {"compute_device_type": device}):
        preferences.refresh_devices()
        found = [item for item in preferences.devices if item.type == device]
        if not found:
            raise LfsrError(f"device is {device!r}, but this machine has none that Blender can use: "
                            "render on the CPU or check the driver")
        before = [(item, item.use) for item in preferences.devices]
        try:
            for item, _ in before:
                item.use = item.type == device
            yield
        finally:
            for item, use in before:
                item.use = use


def _preferences() -> bpy.types.AddonPreferences:
    addon = bpy.context.preferences.addons.get("cycles")
    if addon is None:
        raise LfsrError("Cycles is switched off in Blender's preferences: switch the Cycles add-on on")
    return addon.preferences
