"""Open Image Denoise on a whole EIA, with weights for elemental images, its own or both, and the files of weights.

The EIA is denoised, not its views: the views of a low-resolution array lie far apart, the pixels of one EI do not, so
the EIA keeps far more detail (measured). Every other EI is mirrored before, so that neighbours meet at the same view
and the image has no edges where the scene has none (docs/results/networks.md).

The library's network is a U-Net of 3×3 convolutions with bias: ReLU after all but the last, 2×2 max-pooling after
enc_conv1 to 4, nearest upsampling and a skip before dec_conv4a to 1a, zeros around the image up to a multiple of 16.
Widths come from the tensors.

Its C library is the user's choice, that of the package pyoidn, Blender's, or the system's (OpenImageDenoise/oidn.h,
version 2). pyoidn itself is not imported: it takes no weights of ours and loads PyTorch.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import dataclasses
import functools
import hashlib
import importlib.util
import itertools
import math
import os
import struct
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array, spread
from lfsr_core.base.messages import LfsrError, Notice, silent
from lfsr_core.base.system import read_bytes, read_json
from lfsr_core.frames.frame import DEVICES_JOINED
from lfsr_core.optics.rays import from_elemental_images, to_elemental_images
from lfsr_core.process.child import BLENDER_FOLDER
from lfsr_core.reconstruct.upscaler import LowResEIA

CONTEXT = 32  # pixels around the wanted ones that the denoiser sees too
LEAST_LEFT, MOST_LOST = 0.1, 0.1  # fraction of its light that an EI must keep, and fraction of EIs that may keep less
POOLED = 16  # pixels that the denoiser's network pools into one
MOST_TWICE = 1_000_000  # pixels of a render that both weights denoise; for larger ones rays are worth more
# Slopes (lenses per rendered view) between which samples change from denoising in elemental images to denoising in
# views; least mean weight of views for which they are denoised at all; samples over which edges take known slopes.
DEEP, LEAST_DEEP, EDGE = (1.0, 1.5), 0.02, 2

Box = tuple[slice, slice]  # rows and columns of lenses
WEIGHTS = Path(__file__).parents[1] / "weights" / "denoiser.tza"
INPUT = "input"
LAYERS = ("enc_conv0", "enc_conv1", "enc_conv2", "enc_conv3", "enc_conv4", "enc_conv5a", "enc_conv5b",
          "dec_conv4a", "dec_conv4b", "dec_conv3a", "dec_conv3b", "dec_conv2a", "dec_conv2b", "dec_conv1a",
          "dec_conv1b", "dec_conv0")
# What is concatenated with the upsampled layer before these.
SKIPS = {"dec_conv4a": "enc_conv3", "dec_conv3a": "enc_conv2", "dec_conv2a": "enc_conv1", "dec_conv1a": INPUT}
COLOR_INPUTS, GUIDED_INPUTS = 3, 9  # colour; colour, albedo and normal
HEADER = struct.Struct("<HBBQ")  # magic number, version, its second part, offset of the table
MAGIC, VERSION, MINOR = 0x41D7, 2, 0
MOST_BYTES, MOST_TENSORS = 8_000_000, 256
LAYOUTS = {1: b"x", 4: b"oihw"}  # by number of axes
TYPES: dict[bytes, np.dtype[Any]] = {b"f": np.dtype("<f4"), b"h": np.dtype("<f2")}
# Relative to pyoidn's folder or Blender's: Linux, macOS, Windows (pyoidn, Blender, the bpy wheel).
PLACES = ("lib/libOpenImageDenoise.so.2", "lib/libOpenImageDenoise.dylib", "bin/OpenImageDenoise.dll",
          "blender.shared/OpenImageDenoise.dll", "OpenImageDenoise.dll")
# Of a distribution, where the loader finds it, and of Homebrew.
SYSTEM_LIBRARIES = {"linux": ("libOpenImageDenoise.so.2",), "darwin": (
    "/opt/homebrew/lib/libOpenImageDenoise.dylib", "/usr/local/lib/libOpenImageDenoise.dylib")}
LIBRARY_VARIABLE = "LFSR_OIDN"  # environment variable: the library to use
MODULES = "OpenImageDenoise_device_*.dll"  # Windows finds what these need only if they are loaded by their paths
FLOAT3 = 3  # OIDNFormat
DEVICE_TYPES = {"CPU": 1, "ONEAPI": 2, "CUDA": 3, "OPTIX": 3, "HIP": 4, "METAL": 5}  # OIDNDeviceType, by Cycles' device
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
                     "oidnExecuteFilter", "oidnReleaseFilter"), (None, (_HANDLE,)))}


@dataclasses.dataclass(frozen=True)
class Wanted:
    """A device of Cycles."""

    kind: str = "CPU"  # one of DEVICE_TYPES
    addresses: tuple[str, ...] = ()  # PCI addresses such as "0000:65:00", of which any will do; empty for any device

    @classmethod
    def of(cls, device: str, addresses: tuple[str, ...] = ()) -> Wanted:
        """The device that ``frame.device`` names: a GPU where there is one, the CPU where the name says nothing."""
        kind = next((kind for kind in device.split(DEVICES_JOINED) if kind in DEVICE_TYPES and kind != "CPU"), "CPU")
        return cls() if kind == "CPU" else cls(kind, addresses)


CPU = Wanted()


def denoise_eia(color: Array, guides: Array | None = None, *, weights: Weights | None = None, exposure: float = 0.0,
                device: Wanted = CPU, note: Note = silent) -> Array:
    """Denoise one image (H, W, 3), scene-linear >= 0; LfsrError where the library is missing or fails.

    ``guides``: albedo and normal (H, W, 6) for guided weights, None for zeros. ``weights``: they see display white as
    1, by ``exposure``, that of the view transform in stops; None for the library's own, which see colour alone and
    expose by themselves. ``device``, ``note``: see ``denoise_image``.
    """
    seen = [color]
    if weights is not None and weights.guided:
        guides = np.zeros((*color.shape[:2], 6), np.float32) if guides is None else guides
        seen += [guides[..., :3], guides[..., 3:]]
    check_library()
    try:
        denoised = denoise_image(*seen, device=device, note=note, weights=None if weights is None else weights.content,
                                 input_scale=None if weights is None else 2.0 ** exposure)
    except RuntimeError as error:
        raise LfsrError(f"Open Image Denoise failed on an image of shape {color.shape} ({error}): "
                        "choose a method without a denoiser, such as 'bilinear'") from None
    return np.asarray(np.maximum(denoised, 0))


def denoise_low_resolution(low: LowResEIA, weights: str | Path | None = WEIGHTS) -> LowResEIA:
    """Denoise the colour of a low-resolution EIA; the rendered colour stays in the layer "noisy".

    ``weights``: a TZA file, None for the library's own. Lenses that show only the background are left out, and pixels
    that show it in their own and in the neighbouring lenses keep its colour. LfsrError where the file is missing or
    damaged. A small render becomes the mean of what our weights and the library's make of it: ours keep more of thin
    parts, the library's leave less noise on plain surfaces (docs/notebook/responsiveness.md).
    """
    if 0 < low.pixels <= MOST_TWICE and weights == WEIGHTS:
        ours, own = (denoise_low_resolution(dataclasses.replace(low, pixels=0), each) for each in (WEIGHTS, None))
        return dataclasses.replace(ours, color=(ours.color + own.color) / 2, pixels=low.pixels)
    loaded, notes = None if weights is None else load(weights), list(low.notes)
    guides = low.guides if loaded is not None and loaded.guided else None

    def side_by_side(color: Array, guides: Array | None) -> Array:
        """Denoise images (rows, columns, h, w, 3), every other one of them mirrored."""
        images, part = mirrored(color), shown_part(color)
        rows, columns = images[part].shape[:2]
        if rows * columns:
            seen = None if guides is None else from_elemental_images(mirrored(guides)[part])
            denoised = denoise_eia(from_elemental_images(images[part]), seen, weights=loaded, exposure=low.exposure,
                                   device=Wanted.of(low.device, low.gpus), note=notes.append)
            images[part] = to_elemental_images(denoised, (columns, rows))
        return mirrored(images)

    color, deep, part = side_by_side(low.color, guides), _deep(low), shown_part(low.color)
    before, after = (image[part].mean((2, 3, 4)) for image in (low.color, color))
    shine, kept = before > 0, (after > LEAST_LEFT * before) & np.isfinite(after)
    lost = (shine & ~kept).sum()
    if weights is not None and Path(weights) != WEIGHTS and lost > MOST_LOST * shine.sum():
        raise LfsrError(f"weights {weights} make {lost} of {shine.sum()} elemental images black or infinite: "
                        "their numbers overflow. Train them again, or use others")
    if deep.mean() > LEAST_DEEP:
        turned = (2, 3, 0, 1, 4)  # from elemental images to views, and back
        views = side_by_side(low.color.transpose(turned), None if guides is None else guides.transpose(turned))
        color = np.where(deep > 0, color + deep * (views.transpose(turned) - color), color)
    np.copyto(color, low.color, where=(low.alpha == 0) & is_even(low.alpha) & is_even(low.color))
    return dataclasses.replace(low, color=color, noisy=low.color, notes=tuple(notes))


def _deep(low: LowResEIA) -> Array:
    """Weights (sy, sx, h, w, 1), 0 to 1, with which each sample is denoised in its view, not in its elemental image.

    From one rendered view to the next a point moves by its slope, from one lens to the next by one: beyond a slope of
    1 a view has more detail than an elemental image. Edges, whose slope is unknown, take the steepest one beside them.
    Blocks of lenses are too small for views.
    """
    if low.slope is None or low.block is not None:
        return np.zeros((1,) * 5, np.float32)
    slope = spread(np.nan_to_num(np.abs(low.slope[..., 0]), nan=np.inf), EDGE * (low.samples > 1), range(4), np.inf)
    return np.asarray(np.clip((slope - DEEP[0]) / (DEEP[1] - DEEP[0]), 0, 1) * np.isfinite(slope))[..., None]


def denoised_opacity(low: LowResEIA) -> LowResEIA:
    """Denoise a low-resolution EIA whose colour is the opacity in [0, 1] before a world."""
    ready, opacity = denoise_low_resolution(dataclasses.replace(low, noisy=None, pixels=0)), low.color
    # A denoiser must not spread opacity into elemental images without any.
    cleaned = np.clip(ready.color, 0, 1) * opacity.any((2, 3, 4), keepdims=True)
    return dataclasses.replace(ready, color=np.where(is_even(opacity), opacity, cleaned))


def is_even(images: Array) -> Array:
    """Pixels (sy, sx, h, w, 1) that equal those of the same view in the neighbouring lenses: there is no noise."""
    even = np.ones(images.shape[:4], bool)
    for axis, channel in itertools.product((0, 1), np.moveaxis(images, -1, 0)):
        lenses, evens = np.moveaxis(channel, axis, 0), np.moveaxis(even, axis, 0)
        equal = lenses[1:] == lenses[:-1]
        evens[1:] &= equal
        evens[:-1] &= equal
    return even[..., None]


def mirrored(images: Array) -> Array:
    """Mirror the EIs (sy, sx, h, w, C) of every other row and column, so that neighbours meet at the same view.

    Applied twice, it changes nothing.
    """
    result = images.copy()
    result[1::2] = result[1::2, :, ::-1]
    result[:, 1::2] = result[:, 1::2, :, ::-1]
    return result


def shown_part(color: Array) -> Box:
    """Bounding box of the lenses whose elemental images are not constant, with CONTEXT around; it may be empty.

    ``color``: (sy, sx, h, w, C).
    """
    values, channels = color.reshape(*color.shape[:2], -1), color.shape[-1]
    varies = (values[:, :, channels:] != values[:, :, :-channels]).any(-1)
    return span(varies.any(1), color.shape[2]), span(varies.any(0), color.shape[3])


def span(wanted: Array, pixels: int) -> slice:
    """Span of the (n,) wanted lenses, of ``pixels`` each, with CONTEXT around; it may be empty.

    It starts on a multiple of POOLED pixels, so that the denoiser pools as in the whole image.
    """
    places = np.flatnonzero(wanted)
    if not len(places):
        return slice(0, 0)
    around, step = math.ceil(CONTEXT / pixels), POOLED // math.gcd(POOLED, pixels)
    return slice(max(places[0] - around, 0) // step * step, min(places[-1] + 1 + around, len(wanted)))


@dataclasses.dataclass(frozen=True)
class Weights:
    """A checked file for the library."""

    content: bytes
    guided: bool  # whether the network sees albedo and normal too


def network_shapes(widths: Sequence[int], inputs: int = COLOR_INPUTS) -> dict[str, tuple[int, ...]]:
    """Shapes of all tensors, by name, of a network with ``widths`` channels after each of LAYERS."""
    channels = {INPUT: inputs, **dict(zip(LAYERS, widths, strict=True))}
    before = dict(zip(LAYERS, (INPUT, *LAYERS), strict=False))
    shapes: dict[str, tuple[int, ...]] = {}
    for layer in LAYERS:
        entering = channels[before[layer]] + (channels[SKIPS[layer]] if layer in SKIPS else 0)
        shapes |= {f"{layer}.weight": (channels[layer], entering, 3, 3), f"{layer}.bias": (channels[layer],)}
    return shapes


def check_network(tensors: Mapping[str, Array], origin: object, inputs: int = COLOR_INPUTS) -> tuple[int, ...]:
    """Widths of the network of ``tensors``; LfsrError unless they are all of it, with ``inputs`` channels."""
    actual = {name: tensor.shape for name, tensor in tensors.items()}
    widths = [actual.get(f"{layer}.bias", (0,))[0] for layer in LAYERS]
    widths[-1] = 3
    shapes = network_shapes(widths, inputs)
    for name in sorted(shapes.keys() | actual.keys()):
        if actual.get(name) != shapes.get(name):
            raise LfsrError(f"{origin} has tensor {name[:40]!r} of shape {actual.get(name, 'missing')}, expected "
                            f"{shapes.get(name, 'no such tensor')}: choose weights of a denoiser with {inputs} inputs")
    return tuple(widths)


def load(path: str | Path = WEIGHTS) -> Weights:
    """Checked weights for colour, or for colour, albedo and normal; LfsrError where the file is missing or damaged.

    The library takes half floats alone, and other tensors are refused.
    """
    path = Path(path)
    return _load(path, path.stat().st_mtime_ns if path.exists() else 0)


@functools.lru_cache(maxsize=4)
def _load(path: Path, _written: int) -> Weights:
    content = read_bytes(path, "TZA weights", MOST_BYTES)
    tensors = parse_tza(content, path)
    entering = tensors[f"{LAYERS[0]}.weight"].shape[1:2] if f"{LAYERS[0]}.weight" in tensors else ()
    inputs = GUIDED_INPUTS if entering == (GUIDED_INPUTS,) else COLOR_INPUTS
    check_network(tensors, path, inputs)
    facts = path.with_suffix(".json")
    stated = digest = hashlib.sha256(content).hexdigest()
    with contextlib.suppress(LfsrError, LookupError, TypeError):  # a training writes them beside the weights
        stated = read_json(facts, "the facts of a training")["sha256"]
    if digest != stated:
        raise LfsrError(f"{path} does not have the SHA-256 in {facts.name}: it was changed or damaged, get both again")
    if any(tensor.dtype != np.float16 for tensor in tensors.values()):
        raise LfsrError(f"{path} holds single floats, but Open Image Denoise takes half floats: write them as such")
    return Weights(content, inputs == GUIDED_INPUTS)


def parse_tza(content: bytes, origin: object) -> dict[str, Array]:
    """Tensors of a file's bytes; ``origin`` names them in the LfsrError of damaged ones."""
    try:
        return dict(_entries(content))
    except (ValueError, struct.error) as error:
        raise LfsrError(f"{origin} cannot be read as TZA weights ({error}): get it again or train it again") from None


def _entries(content: bytes) -> Iterator[tuple[str, Array]]:
    """Name and values of every tensor; ValueError or struct.error where the bytes are damaged."""
    magic, version, _, at = HEADER.unpack_from(content)
    if (magic, version) != (MAGIC, VERSION):
        raise ValueError(f"it begins with {magic:#06x} version {version}, expected {MAGIC:#06x} version {VERSION}")
    if at > len(content):
        raise ValueError(f"its table is at byte {at} of {len(content)}")
    (count,) = struct.unpack_from("<I", content, at)
    if count > MOST_TENSORS:
        raise ValueError(f"it has {count} tensors, expected at most {MOST_TENSORS}")
    at, seen = at + 4, set[str]()
    for _ in range(count):
        (length,) = struct.unpack_from("<H", content, at)
        name, at = content[at + 2:at + 2 + length].decode("ascii", errors="replace"), at + 2 + length
        (axes,) = struct.unpack_from("<B", content, at)
        if axes not in LAYOUTS:
            raise ValueError(f"tensor {name[:40]!r} has {axes} axes, expected 1 or 4")
        *shape, layout, kind, start = struct.unpack_from(f"<{axes}I{axes}scQ", content, at + 1)
        at += struct.calcsize(f"<B{axes}I{axes}scQ")
        if layout != LAYOUTS[axes] or kind not in TYPES:
            raise ValueError(f"tensor {name[:40]!r} has layout {layout!r} and type {kind!r}, expected "
                             f"{LAYOUTS[axes]!r} and b'f' or b'h'")
        size = math.prod(shape)
        if not 0 < size <= MOST_BYTES or start + size * TYPES[kind].itemsize > len(content):
            raise ValueError(f"tensor {name[:40]!r} of shape {tuple(shape)} at byte {start} does not fit "
                             f"{len(content)} bytes")
        tensor = np.frombuffer(content, TYPES[kind], size, start).reshape(shape)
        if not np.isfinite(tensor).all():
            raise ValueError(f"tensor {name[:40]!r} has values that are not finite")
        if name in seen:
            raise ValueError(f"it has tensor {name!r} twice")
        seen.add(name)
        yield name, tensor


def denoise_image(color: Array, albedo: Array | None = None, normal: Array | None = None, *,
                  clean_aux: bool = False, quality: str = "high", weights: bytes | None = None,
                  input_scale: float | None = None, device: Wanted = CPU, note: Note = silent) -> Array:
    """Denoise an image (H, W, 3), float32, whose values may exceed 1; a normal needs an albedo.

    ``input_scale``: multiplies the values before the network, None to let the library expose by itself. ``clean_aux``:
    albedo and normal have no noise. ``weights``: content of a checked TZA file instead of the library's own.
    ``device``: the one that rendered; where it cannot be had or fails, ``note`` gets a notice and the CPU denoises.
    ImportError where no library is found or loads, RuntimeError where it fails on the CPU.
    """
    library = _load_library(tuple(find_libraries()))
    given = {"color": color, "albedo": albedo, "normal": normal}
    images = {name: np.ascontiguousarray(image, np.float32) for name, image in given.items() if image is not None}

    def configure(work: int) -> None:
        library.oidnSetFilterBool(work, b"hdr", True)
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

    The system's comes last. Its path may be a bare name, which the system's loader looks up.
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
        _load_library(tuple(find_libraries()))
    except ImportError as error:
        return str(error)
    return ""


def check_library() -> None:
    """LfsrError where no library loads."""
    if why := why_missing():
        raise LfsrError(f"Open Image Denoise is not available ({why}): install the package pyoidn, or choose a "
                        "method without a denoiser, such as 'bilinear'")


def _package(name: str) -> Iterator[Path]:
    spec = importlib.util.find_spec(name)
    yield from map(Path, spec.submodule_search_locations or () if spec else ())


@functools.lru_cache(maxsize=4)
def _load_library(paths: tuple[Path, ...]) -> ctypes.CDLL:
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
    device: int = (library.oidnNewDevice(DEVICE_TYPES[wanted.kind]) if physical is None
                   else library.oidnNewDeviceByID(physical))
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
        if library.oidnGetPhysicalDeviceInt(number, b"type") != DEVICE_TYPES[wanted.kind] \
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
    if code := library.oidnGetDeviceError(device, ctypes.byref(message)):
        reason = (message.value or b"no reason given").decode(errors="replace")
        raise RuntimeError(f"error {code}: {reason}")
