"""Open Image Denoise through its C library: the user's choice, that of the package pyoidn, Blender's, or the system's.

Blender ships the library beside its Python, so the extension need not bring another 50 to 90 MB; distributions build
Blender without it, and some have a package of it. pyoidn is not imported: it offers no weights of ours and loads
PyTorch. Only the functions that ``denoise.py`` needs are bound (OpenImageDenoise/oidn.h, version 2).
"""

from __future__ import annotations

import ctypes
import dataclasses
import functools
import importlib.util
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lfsr_core.arrays import Array
from lfsr_core.render.protocol import BLENDER_FOLDER

# Relative to pyoidn's folder or Blender's: Linux, macOS, Windows (pyoidn, Blender, the bpy wheel).
PLACES = ("lib/libOpenImageDenoise.so.2", "lib/libOpenImageDenoise.dylib", "bin/OpenImageDenoise.dll",
          "blender.shared/OpenImageDenoise.dll", "OpenImageDenoise.dll")
# Of a distribution, where the loader finds it, and of Homebrew.
SYSTEM_LIBRARIES = {"linux": ("libOpenImageDenoise.so.2",), "darwin": (
    "/opt/homebrew/lib/libOpenImageDenoise.dylib", "/usr/local/lib/libOpenImageDenoise.dylib")}
LIBRARY_VARIABLE = "LFSR_OIDN"  # environment variable: the library to use
CPU_MODULE = "OpenImageDenoise_device_cpu.dll"  # Windows finds what it needs only if it is loaded by its path
CPU_DEVICE, FLOAT3 = 1, 3  # OIDNDeviceType, OIDNFormat
QUALITIES = {"fast": 4, "balanced": 5, "high": 6}  # OIDNQuality; "fast" exists since library 2.3

_HANDLE, _SIZE, _NAME = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p
SIGNATURES: dict[str, tuple[object, tuple[object, ...]]] = {
    "oidnNewDevice": (_HANDLE, (ctypes.c_int,)),
    "oidnCommitDevice": (None, (_HANDLE,)),
    "oidnGetDeviceError": (ctypes.c_int, (_HANDLE, ctypes.POINTER(_NAME))),
    "oidnReleaseDevice": (None, (_HANDLE,)),
    "oidnNewFilter": (_HANDLE, (_HANDLE, _NAME)),
    "oidnSetSharedFilterImage": (None, (_HANDLE, _NAME, _HANDLE, ctypes.c_int, *(_SIZE,) * 5)),
    "oidnSetSharedFilterData": (None, (_HANDLE, _NAME, _HANDLE, _SIZE)),
    "oidnSetFilterBool": (None, (_HANDLE, _NAME, ctypes.c_bool)),
    "oidnSetFilterInt": (None, (_HANDLE, _NAME, ctypes.c_int)),
    "oidnSetFilterFloat": (None, (_HANDLE, _NAME, ctypes.c_float)),
    "oidnCommitFilter": (None, (_HANDLE,)),
    "oidnExecuteFilter": (None, (_HANDLE,)),
    "oidnReleaseFilter": (None, (_HANDLE,)),
}


def denoise(color: Array, albedo: Array | None = None, normal: Array | None = None, *,
            hdr: bool = False, srgb: bool = False, clean_aux: bool = False, quality: str = "high",
            weights: bytes | None = None, input_scale: float | None = None) -> Array:
    """Denoise an image (H, W, 3) on the CPU, float32; a normal needs an albedo.

    ``hdr``: values may exceed 1; they are multiplied by ``input_scale`` before the network, None to let the library
    expose by itself. ``srgb``: values in [0, 1] that are encoded already. ``clean_aux``: albedo and normal have no
    noise. ``weights``: content of a checked TZA file (``reconstruct/denoiser.py``) instead of the library's own.
    ImportError where no library is found or loads, RuntimeError where it fails.
    """
    library = _load(tuple(find_libraries()))
    given = {"color": color, "albedo": albedo, "normal": normal, "output": np.empty(color.shape, np.float32)}
    images = {name: np.ascontiguousarray(image, np.float32) for name, image in given.items() if image is not None}
    settings = Settings(hdr, srgb, clean_aux, QUALITIES[quality], weights, input_scale)
    device = library.oidnNewDevice(CPU_DEVICE)
    try:
        library.oidnCommitDevice(device)
        _run(library, device, images, settings)
        _check(library, device)
    finally:
        library.oidnReleaseDevice(device)
    return images["output"]


@dataclasses.dataclass(frozen=True)
class Settings:
    """What a filter is told besides its images, see ``denoise``."""

    hdr: bool
    srgb: bool
    clean_aux: bool
    quality: int
    weights: bytes | None
    input_scale: float | None


def find_libraries() -> Iterator[Path]:
    """Paths of the libraries, the best first: $LFSR_OIDN alone, or pyoidn's, Blender's; no package is imported.

    The system's comes last and need not exist where it has no folder: its loader looks for it.
    """
    if chosen := os.environ.get(LIBRARY_VARIABLE):
        yield Path(chosen)
        return
    yield from (path for folder in _folders() for path in map(folder.joinpath, PLACES) if path.is_file())
    yield from map(Path, SYSTEM_LIBRARIES.get(sys.platform, ()))


def why_missing() -> str:
    """Return why no library loads, "" where one does."""
    try:
        _load(tuple(find_libraries()))
    except ImportError as error:
        return str(error)
    return ""


def _folders() -> Iterator[Path]:
    yield from (folder / "oidn" for folder in _package("pyoidn"))
    yield from _package("bpy")
    if folder := os.environ.get(BLENDER_FOLDER):
        yield Path(folder)
    if Path(sys.prefix).name == "python":  # .../5.0/python in every Blender
        yield Path(sys.prefix).parents[1]


def _package(name: str) -> Iterator[Path]:
    spec = importlib.util.find_spec(name)
    yield from map(Path, spec.submodule_search_locations or () if spec else ())


@functools.lru_cache(maxsize=4)
def _load(paths: tuple[Path, ...]) -> ctypes.CDLL:
    """The first library that loads."""
    problems = []
    for path in paths:
        try:
            return _bound(path)
        except (OSError, AttributeError) as error:
            problems += [f"{path} cannot be loaded: {error}"] if path.name != str(path) else []
    raise ImportError(problems[0] if problems else "neither pyoidn nor a libOpenImageDenoise of Blender or the system "
                      "was found")


def _bound(path: Path) -> ctypes.CDLL:
    if path.with_name(CPU_MODULE).is_file():
        ctypes.CDLL(str(path.with_name(CPU_MODULE)))
    library = ctypes.CDLL(str(path))
    for name, (result, arguments) in SIGNATURES.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


def _run(library: ctypes.CDLL, device: int, images: dict[str, Array], settings: Settings) -> None:
    height, width, _ = images["color"].shape
    work = library.oidnNewFilter(device, b"RT")
    _check(library, device)
    try:
        for name, image in images.items():
            library.oidnSetSharedFilterImage(work, name.encode(), image.ctypes.data, FLOAT3, width, height, 0, 0, 0)
        library.oidnSetFilterBool(work, b"hdr", settings.hdr)
        library.oidnSetFilterBool(work, b"srgb", settings.srgb)
        library.oidnSetFilterBool(work, b"cleanAux", settings.clean_aux)
        library.oidnSetFilterInt(work, b"quality", settings.quality)
        if settings.weights is not None:  # not copied: they must outlive the filter
            library.oidnSetSharedFilterData(work, b"weights", settings.weights, len(settings.weights))
        if settings.input_scale is not None:
            library.oidnSetFilterFloat(work, b"inputScale", settings.input_scale)
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
