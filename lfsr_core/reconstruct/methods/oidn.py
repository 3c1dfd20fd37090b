"""Open Image Denoise through its C library: the user's choice, that of the package pyoidn, Blender's, or the system's.

Blender ships the library beside its Python, so the extension need not bring another 50 to 90 MB; distributions build
Blender without it, and some have a package of it. pyoidn is not imported: it offers no weights of ours and loads
PyTorch. Only the functions that ``denoise.py`` needs are bound (OpenImageDenoise/oidn.h, version 2).
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import dataclasses
import functools
import importlib.util
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import Notice, silent
from lfsr_core.frames.frame import DEVICES_JOINED
from lfsr_core.process.child import BLENDER_FOLDER

# Relative to pyoidn's folder or Blender's: Linux, macOS, Windows (pyoidn, Blender, the bpy wheel).
PLACES = ("lib/libOpenImageDenoise.so.2", "lib/libOpenImageDenoise.dylib", "bin/OpenImageDenoise.dll",
          "blender.shared/OpenImageDenoise.dll", "OpenImageDenoise.dll")
# Of a distribution, where the loader finds it, and of Homebrew.
SYSTEM_LIBRARIES = {"linux": ("libOpenImageDenoise.so.2",), "darwin": (
    "/opt/homebrew/lib/libOpenImageDenoise.dylib", "/usr/local/lib/libOpenImageDenoise.dylib")}
LIBRARY_VARIABLE = "LFSR_OIDN"  # environment variable: the library to use
MODULES = "OpenImageDenoise_device_*.dll"  # Windows finds what these need only if they are loaded by their paths
FLOAT3 = 3  # OIDNFormat
TYPES = {"CPU": 1, "ONEAPI": 2, "CUDA": 3, "OPTIX": 3, "HIP": 4, "METAL": 5}  # OIDNDeviceType, by Cycles' device
QUALITIES = {"fast": 4, "balanced": 5, "high": 6}  # OIDNQuality; "fast" exists since library 2.3
Note = Callable[[Notice], object]  # what hears a notice

_HANDLE, _SIZE, _NAME = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p
SIGNATURES: dict[str, tuple[object, tuple[object, ...]]] = {
    "oidnGetNumPhysicalDevices": (ctypes.c_int, ()),
    "oidnGetPhysicalDeviceBool": (ctypes.c_bool, (ctypes.c_int, _NAME)),
    "oidnGetPhysicalDeviceInt": (ctypes.c_int, (ctypes.c_int, _NAME)),
    **dict.fromkeys(("oidnNewDevice", "oidnNewDeviceByID"), (_HANDLE, (ctypes.c_int,))),
    "oidnGetDeviceError": (ctypes.c_int, (_HANDLE, ctypes.POINTER(_NAME))),
    "oidnNewBuffer": (_HANDLE, (_HANDLE, _SIZE)),
    "oidnNewSharedBuffer": (_HANDLE, (_HANDLE, _HANDLE, _SIZE)),
    **dict.fromkeys(("oidnWriteBuffer", "oidnReadBuffer"), (None, (_HANDLE, _SIZE, _SIZE, _HANDLE))),
    "oidnNewFilter": (_HANDLE, (_HANDLE, _NAME)),
    "oidnSetFilterImage": (None, (_HANDLE, _NAME, _HANDLE, ctypes.c_int, *(_SIZE,) * 5)),
    "oidnSetSharedFilterData": (None, (_HANDLE, _NAME, _HANDLE, _SIZE)),
    **{f"oidnSetFilter{kind}": (None, (_HANDLE, _NAME, of)) for kind, of in (
        ("Bool", ctypes.c_bool), ("Int", ctypes.c_int), ("Float", ctypes.c_float))},
    **dict.fromkeys(("oidnCommitDevice", "oidnReleaseDevice", "oidnReleaseBuffer", "oidnCommitFilter",
                     "oidnExecuteFilter", "oidnReleaseFilter"), (None, (_HANDLE,))),
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


def denoise(color: Array, albedo: Array | None = None, normal: Array | None = None, *,
            hdr: bool = False, srgb: bool = False, clean_aux: bool = False, quality: str = "high",
            weights: bytes | None = None, input_scale: float | None = None, device: Wanted = CPU,
            note: Note = silent) -> Array:
    """Denoise an image (H, W, 3), float32; a normal needs an albedo.

    ``hdr``: values may exceed 1; they are multiplied by ``input_scale`` before the network, None to let the library
    expose by itself. ``srgb``: values in [0, 1] that are encoded already. ``clean_aux``: albedo and normal have no
    noise. ``weights``: content of a checked TZA file (``denoise.py``) instead of the library's own.
    ``device``: the one that rendered; where it cannot be had or fails, ``note`` gets a notice and the CPU denoises.
    ImportError where no library is found or loads, RuntimeError where it fails on the CPU.
    """
    library = _load(tuple(find_libraries()))
    given = {"color": color, "albedo": albedo, "normal": normal}
    images = {name: np.ascontiguousarray(image, np.float32) for name, image in given.items() if image is not None}

    def configure(work: int) -> None:
        library.oidnSetFilterBool(work, b"hdr", hdr)
        library.oidnSetFilterBool(work, b"srgb", srgb)
        library.oidnSetFilterBool(work, b"cleanAux", clean_aux)
        library.oidnSetFilterInt(work, b"quality", QUALITIES[quality])
        if weights is not None:  # not copied: they must outlive the filter
            library.oidnSetSharedFilterData(work, b"weights", weights, len(weights))
        if input_scale is not None:
            library.oidnSetFilterFloat(work, b"inputScale", input_scale)

    if device.kind != "CPU":
        try:
            return _run(library, kept(library, device), images, configure, copies=True)
        except RuntimeError as error:
            note(Notice("denoised-on-cpu", {"device": device.kind, "error": str(error)}))
    return _run(library, kept(library, CPU), images, configure, copies=False)


def find_libraries() -> Iterator[Path]:
    """Paths of the libraries, the best first: $LFSR_OIDN alone, or pyoidn's, Blender's; no package is imported.

    The system's comes last and need not exist where it has no folder: its loader looks for it.
    """
    if chosen := os.environ.get(LIBRARY_VARIABLE):
        yield Path(chosen)
        return
    folders = [*(folder / "oidn" for folder in _package("pyoidn")), *_package("bpy")]
    if blender := os.environ.get(BLENDER_FOLDER):
        folders.append(Path(blender))
    if Path(sys.prefix).name == "python":  # .../5.0/python in every Blender
        folders.append(Path(sys.prefix).parents[1])
    yield from (path for folder in folders for path in map(folder.joinpath, PLACES) if path.is_file())
    yield from map(Path, SYSTEM_LIBRARIES.get(sys.platform, ()))


def why_missing() -> str:
    """Return why no library loads, "" where one does."""
    try:
        _load(tuple(find_libraries()))
    except ImportError as error:
        return str(error)
    return ""


def _package(name: str) -> Iterator[Path]:
    spec = importlib.util.find_spec(name)
    yield from map(Path, spec.submodule_search_locations or () if spec else ())


@functools.lru_cache(maxsize=4)
def _load(paths: tuple[Path, ...]) -> ctypes.CDLL:
    """The first library that loads."""
    problems = []
    for path in paths:
        try:
            for module in path.parent.glob(MODULES):
                with contextlib.suppress(OSError):  # of a GPU whose driver is not installed
                    ctypes.CDLL(str(module))
            library = ctypes.CDLL(str(path))
            for name, (result, arguments) in SIGNATURES.items():
                function = getattr(library, name)
                function.restype, function.argtypes = result, arguments
            return library
        except (OSError, AttributeError) as error:
            problems += [f"{path} cannot be loaded: {error}"] if path.name != str(path) else []
    raise ImportError(problems[0] if problems else "neither pyoidn nor a libOpenImageDenoise of Blender or the system "
                      "was found")


def _run(library: ctypes.CDLL, device: int, images: dict[str, Array], configure: Callable[[int], None], *,
         copies: bool) -> Array:
    """The denoised image; ``copies``: the device has memory of its own, so the images are copied to it and back."""
    (height, width, _), result = images["color"].shape, np.empty(images["color"].shape, np.float32)
    with contextlib.ExitStack() as stack:
        work = library.oidnNewFilter(device, b"RT")
        check(library, device)
        stack.callback(library.oidnReleaseFilter, work)
        for name, image in {**images, "output": result}.items():
            buffer = (library.oidnNewBuffer(device, image.nbytes) if copies
                      else library.oidnNewSharedBuffer(device, image.ctypes.data, image.nbytes))
            check(library, device)
            stack.callback(library.oidnReleaseBuffer, buffer)
            if copies and name in images:
                library.oidnWriteBuffer(buffer, 0, result.nbytes, images[name].ctypes.data)
            library.oidnSetFilterImage(work, name.encode(), buffer, FLOAT3, width, height, 0, 0, 0)
        configure(work)
        library.oidnCommitFilter(work)
        library.oidnExecuteFilter(work)
        check(library, device)
        if copies:
            library.oidnReadBuffer(buffer, 0, result.nbytes, result.ctypes.data)
            check(library, device)
    return result


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
