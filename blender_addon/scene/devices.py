"""Choose the device of Cycles, and what sends the rays on it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

import bpy

from lfsr_core.base.messages import LfsrError
from lfsr_core.frames.request import AUTO

from .overrides import overridden

# The fastest first: "auto" is the first that this machine has.
GPU_TYPES = ("OPTIX", "CUDA", "HIP", "ONEAPI", "METAL")
WITH_OSL_CAMERA = ("CPU", "OPTIX")
ADDRESS = re.compile(r"[0-9a-f]{4}:[0-9a-f]{2}:[0-9a-f]{2}")


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


def resolved(device: str) -> str:
    """Return ``device`` itself, or for "auto" the best device of this machine."""
    return device if device != AUTO else next(
        (kind for kind in GPU_TYPES if any(item.type == kind for item in _devices(kind))), "CPU")


def _devices(kind: str) -> Sequence[bpy.types.bpy_struct]:
    """Devices of a type on this machine; none for a type that this Blender does not know."""
    preferences = cycles_preferences()
    kinds = {item[0] for item in preferences.get_device_types(bpy.context)}
    return preferences.get_devices_for_type(kind) if kind in kinds else ()


@contextmanager
def enabled(device: str) -> Iterator[None]:
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

    Cycles writes them into the ids of its devices, but for Metal.
    """
    found = (ADDRESS.search(item.id) for item in _devices(device))
    return tuple(dict.fromkeys(match[0] for match in found if match))


def cycles_preferences() -> bpy.types.AddonPreferences:
    """Return the preferences of Cycles; LfsrError if its add-on is switched off."""
    addon = bpy.context.preferences.addons.get("cycles")
    if addon is None:
        raise LfsrError("Cycles is switched off in Blender's preferences: switch the Cycles Render Engine add-on on")
    return addon.preferences
