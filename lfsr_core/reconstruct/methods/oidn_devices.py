"""Devices of Open Image Denoise: the one that rendered, kept for the whole run."""

from __future__ import annotations

import atexit
import ctypes
import dataclasses
import functools
from typing import Any

from lfsr_core.frames.frame import DEVICES_JOINED

TYPES = {"CPU": 1, "ONEAPI": 2, "CUDA": 3, "OPTIX": 3, "HIP": 4, "METAL": 5}  # OIDNDeviceType, by Cycles' device

_HANDLE = ctypes.c_void_p
SIGNATURES: dict[str, tuple[object, tuple[object, ...]]] = {
    "oidnGetNumPhysicalDevices": (ctypes.c_int, ()),
    "oidnGetPhysicalDeviceBool": (ctypes.c_bool, (ctypes.c_int, ctypes.c_char_p)),
    "oidnGetPhysicalDeviceInt": (ctypes.c_int, (ctypes.c_int, ctypes.c_char_p)),
    "oidnNewDevice": (_HANDLE, (ctypes.c_int,)),
    "oidnNewDeviceByID": (_HANDLE, (ctypes.c_int,)),
    "oidnCommitDevice": (None, (_HANDLE,)),
    "oidnGetDeviceError": (ctypes.c_int, (_HANDLE, ctypes.POINTER(ctypes.c_char_p))),
    "oidnReleaseDevice": (None, (_HANDLE,)),
}


@dataclasses.dataclass(frozen=True)
class Wanted:
    """A device of Cycles."""

    kind: str = "CPU"  # one of TYPES
    addresses: tuple[str, ...] = ()  # PCI addresses such as "0000:65:00", of which any will do; empty for any device

    @classmethod
    def of(cls, device: str, addresses: tuple[str, ...] = ()) -> Wanted:
        """The device that ``frame.device`` names: a GPU where there is one, the CPU where the name says nothing."""
        gpus = (kind for kind in device.split(DEVICES_JOINED) if kind in TYPES and kind != "CPU")
        kind = next(gpus, "CPU")
        return cls() if kind == "CPU" else cls(kind, addresses)


CPU = Wanted()


@functools.lru_cache(maxsize=8)
def kept(library: Any, wanted: Wanted) -> int:
    """The device ``wanted`` of a bound library, made once; RuntimeError where this machine refuses it."""
    physical = _physical(library, wanted)
    device: int = library.oidnNewDevice(TYPES[wanted.kind]) if physical is None else library.oidnNewDeviceByID(physical)
    check(library, device)
    if not device:
        raise RuntimeError("there is none")
    library.oidnCommitDevice(device)
    try:
        check(library, device)
    except RuntimeError:
        library.oidnReleaseDevice(device)
        raise
    atexit.register(library.oidnReleaseDevice, device)
    return device


def _physical(library: Any, wanted: Wanted) -> int | None:
    """Number of the physical device at one of the addresses; None for any of its kind."""
    for number in range(library.oidnGetNumPhysicalDevices() if wanted.addresses else 0):
        if library.oidnGetPhysicalDeviceInt(number, b"type") != TYPES[wanted.kind] \
                or not library.oidnGetPhysicalDeviceBool(number, b"pciAddressSupported"):
            continue
        domain, bus, slot = (library.oidnGetPhysicalDeviceInt(number, name)
                             for name in (b"pciDomain", b"pciBus", b"pciDevice"))
        if f"{domain:04x}:{bus:02x}:{slot:02x}" in wanted.addresses:
            return number
    return None


def check(library: Any, device: int | None) -> None:
    """RuntimeError with the library's reason where its last call failed on this thread."""
    message = ctypes.c_char_p()
    code = library.oidnGetDeviceError(device, ctypes.byref(message))
    if code:
        reason = (message.value or b"no reason given").decode(errors="replace")
        raise RuntimeError(f"error {code}: {reason}")
