"""Which processor Cycles uses in this process."""

from __future__ import annotations

import bpy

from lfsr_core.errors import LfsrError


def use_device(device: str, threads: int | None = None) -> None:
    """Choose the CPU, with a number of threads, or every OptiX card; LfsrError where there is none."""
    render = bpy.context.scene.render
    if threads:
        render.threads_mode, render.threads = "FIXED", threads
    if device != "CPU":
        _use_cards(device)


def _use_cards(kind: str) -> None:
    preferences = bpy.context.preferences.addons["cycles"].preferences
    try:
        preferences.compute_device_type = kind
    except TypeError:
        raise LfsrError(f"device is {kind}, but this Blender was built without it: use --device CPU") from None
    preferences.refresh_devices()
    for device in preferences.devices:
        device.use = device.type == kind
    if not any(device.use for device in preferences.devices):
        raise LfsrError(f"device is {kind}, but this machine has no such card: use --device CPU")
