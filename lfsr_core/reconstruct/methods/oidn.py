"""Open Image Denoise through Blender's own library, for a Python without the package pyoidn.

Blender ships the library beside its Python, so the extension need not bring another 50 to 90 MB. Only the functions
that ``denoise.py`` needs are bound (OpenImageDenoise/oidn.h, version 2).
"""

from __future__ import annotations

import ctypes
import functools
import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lfsr_core.arrays import Array

# Relative to a folder above Blender's Python: Linux, macOS, Windows, the bpy wheel on Windows.
PLACES = ("lib/libOpenImageDenoise.so.2", "lib/libOpenImageDenoise.dylib", "blender.shared/OpenImageDenoise.dll",
          "OpenImageDenoise.dll")
CPU_DEVICE, FLOAT3 = 1, 3  # OIDNDeviceType, OIDNFormat
QUALITIES = {"fast": 4, "balanced": 5, "high": 6}  # OIDNQuality; "fast" exists since library 2.3
LEVELS_UP = 6  # from site-packages to the folder of the Blender installation

_HANDLE, _SIZE, _NAME = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p
SIGNATURES: dict[str, tuple[object, tuple[object, ...]]] = {
    "oidnNewDevice": (_HANDLE, (ctypes.c_int,)),
    "oidnCommitDevice": (None, (_HANDLE,)),
    "oidnGetDeviceError": (ctypes.c_int, (_HANDLE, ctypes.POINTER(_NAME))),
    "oidnReleaseDevice": (None, (_HANDLE,)),
    "oidnNewFilter": (_HANDLE, (_HANDLE, _NAME)),
    "oidnSetSharedFilterImage": (None, (_HANDLE, _NAME, _HANDLE, ctypes.c_int, *(_SIZE,) * 5)),
    "oidnSetFilterBool": (None, (_HANDLE, _NAME, ctypes.c_bool)),
    "oidnSetFilterInt": (None, (_HANDLE, _NAME, ctypes.c_int)),
    "oidnCommitFilter": (None, (_HANDLE,)),
    "oidnExecuteFilter": (None, (_HANDLE,)),
    "oidnReleaseFilter": (None, (_HANDLE,)),
}


def denoise(color: Array, albedo: Array | None = None, normal: Array | None = None, *,
            hdr: bool = False, clean_aux: bool = False, quality: str = "high") -> Array:
    """Denoise an image (H, W, 3) on the CPU, with the parameters of ``pyoidn.denoise``.

    ImportError where Blender's library is missing or does not load, RuntimeError where it fails.
    """
    library = _load()
    given = {"color": color, "albedo": albedo, "normal": normal, "output": np.empty(color.shape, np.float32)}
    images = {name: np.ascontiguousarray(image, np.float32) for name, image in given.items() if image is not None}
    device = library.oidnNewDevice(CPU_DEVICE)
    try:
        library.oidnCommitDevice(device)
        _run(library, device, images, {b"hdr": hdr, b"cleanAux": clean_aux}, QUALITIES[quality])
        _check(library, device)
    finally:
        library.oidnReleaseDevice(device)
    return images["output"]


def find_library() -> Path | None:
    """Path of Blender's library: above Blender's Python, or in the bpy wheel, which is not imported."""
    return next((path for folder in _folders() for path in map(folder.joinpath, PLACES) if path.is_file()), None)


def _folders() -> Iterator[Path]:
    spec = importlib.util.find_spec("bpy")
    yield from map(Path, spec.submodule_search_locations or () if spec else ())
    for entry in map(Path, sys.path):
        # .../5.0/python/lib/python3.11/site-packages in every Blender
        if entry.name == "site-packages" and "python" in (parent.name for parent in entry.parents):
            yield from list(entry.parents)[:LEVELS_UP]


@functools.lru_cache(maxsize=1)
def _load() -> ctypes.CDLL:
    path = find_library()
    if path is None:
        raise ImportError("neither pyoidn nor Blender's libOpenImageDenoise was found")
    try:
        library = ctypes.CDLL(str(path))
    except OSError as error:
        raise ImportError(f"{path} cannot be loaded: {error}") from None
    for name, (result, arguments) in SIGNATURES.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


def _run(library: ctypes.CDLL, device: int, images: dict[str, Array], flags: dict[bytes, bool], quality: int) -> None:
    height, width, _ = images["color"].shape
    work = library.oidnNewFilter(device, b"RT")
    _check(library, device)
    try:
        for name, image in images.items():
            library.oidnSetSharedFilterImage(work, name.encode(), image.ctypes.data, FLOAT3, width, height, 0, 0, 0)
        for flag, value in flags.items():
            library.oidnSetFilterBool(work, flag, value)
        library.oidnSetFilterInt(work, b"quality", quality)
        library.oidnCommitFilter(work)
        library.oidnExecuteFilter(work)
    finally:
        library.oidnReleaseFilter(work)


def _check(library: ctypes.CDLL, device: int) -> None:
    message = ctypes.c_char_p()
    code = library.oidnGetDeviceError(device, ctypes.byref(message))
    if code:
        reason = (message.value or b"no reason given").decode(errors="replace")
        raise RuntimeError(f"error {code}: {reason}")
