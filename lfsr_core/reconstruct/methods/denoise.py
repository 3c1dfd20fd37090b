"""Open Image Denoise on a whole EIA, with weights for elemental images or with its own, and the files of such weights.

The EIA is denoised, not its views: the views of a low-resolution array lie far apart, the pixels of one EI do not, so
the EIA keeps far more detail (measured). Every other EI is mirrored for it, so that neighbours meet at the same view
and the image has no edges where the scene has none (docs/results/networks.md).

The library's network is a U-Net of 3×3 convolutions with bias: ReLU after all but the last, 2×2 max-pooling after
enc_conv1 to 4, nearest upsampling and a skip before dec_conv4a to 1a, zeros around the image up to a multiple of 16.
Widths come from the tensors.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import math
import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError, silent
from lfsr_core.base.system import atomic_path, read_bytes, read_json
from lfsr_core.optics.rays import from_elemental_images, to_elemental_images
from lfsr_core.reconstruct.methods import oidn
from lfsr_core.reconstruct.methods.oidn import CPU, Note, Wanted
from lfsr_core.reconstruct.upscaler import LowResEIA

CONTEXT = 32  # pixels around the wanted ones that the denoiser sees too
LEAST_LEFT, MOST_LOST = 0.1, 0.1  # of an elemental image's light, and fraction of those that may keep less
POOLED = 16  # pixels that the denoiser's network pools into one

Box = tuple[slice, slice]  # rows and columns of lenses
WEIGHTS = Path(__file__).parents[1] / "weights" / "denoiser.tza"
INPUT = "input"
LAYERS = ("enc_conv0", "enc_conv1", "enc_conv2", "enc_conv3", "enc_conv4", "enc_conv5a", "enc_conv5b",
          "dec_conv4a", "dec_conv4b", "dec_conv3a", "dec_conv3b", "dec_conv2a", "dec_conv2b", "dec_conv1a",
          "dec_conv1b", "dec_conv0")
# What is concatenated with the upsampled layer before these.
SKIPS = {"dec_conv4a": "enc_conv3", "dec_conv3a": "enc_conv2", "dec_conv2a": "enc_conv1", "dec_conv1a": INPUT}
BASE = (32, 32, 48, 64, 80, 96, 96, 112, 112, 96, 96, 64, 64, 64, 32, 3)  # widths of the library's own networks,
SMALL = (32, 32, 32, 32, 32, 32, 32, 64, 64, 64, 64, 64, 32, 32, 32, 3)  # one channel count per layer
COLOR_INPUTS, GUIDED_INPUTS = 3, 9  # colour; colour, albedo and normal
HEADER = struct.Struct("<HBBQ")  # magic number, version, its second part, offset of the table
MAGIC, VERSION, MINOR = 0x41D7, 2, 0
ALIGNMENT = 64
MOST_BYTES, MOST_TENSORS = 8_000_000, 256
LAYOUTS = {1: b"x", 4: b"oihw"}  # by number of axes
TYPES: dict[bytes, np.dtype[Any]] = {b"f": np.dtype("<f4"), b"h": np.dtype("<f2")}


def denoise_eia(color: Array, guides: Array | None = None, *, weights: Weights | None = None, exposure: float = 0.0,
                device: Wanted = CPU, note: Note = silent) -> Array:
    """Denoise one image (H, W, 3), scene-linear >= 0; LfsrError where the library is missing or fails.

    ``guides``: albedo and normal (H, W, 6) for guided weights, None for zeros. ``weights``: they see display white as
    1; None for the library's own, which see colour alone and expose by themselves. ``exposure``: of the view
    transform in stops, for the first. ``device``, ``note``: see ``oidn.denoise``.
    """
    if reason := oidn.why_missing():
        raise LfsrError(f"Open Image Denoise is not available ({reason}): install the package pyoidn, or choose a "
                        "method without a denoiser, such as 'bilinear'")
    seen = [color]
    if weights is not None and weights.guided:
        guides = np.zeros((*color.shape[:2], 6), np.float32) if guides is None else guides
        seen += [guides[..., :3], guides[..., 3:]]
    try:
        denoised = oidn.denoise(*seen, hdr=True, quality="high", weights=None if weights is None else weights.content,
                                input_scale=None if weights is None else 2.0 ** exposure, device=device, note=note)
    except (ImportError, RuntimeError) as error:
        raise LfsrError(f"Open Image Denoise failed on an image of shape {color.shape} ({error}): "
                        "choose a method without a denoiser, such as 'bilinear'") from None
    return np.asarray(np.maximum(denoised, 0))


def denoise_low_resolution(low: LowResEIA, weights: str | Path | None = WEIGHTS) -> LowResEIA:
    """Denoise the colour of a low-resolution EIA; the rendered colour stays in the layer "noisy".

    ``weights``: a TZA file, None for the library's own. Lenses that show only the background are left out. LfsrError
    where the file is missing or damaged.
    """
    loaded, part = None if weights is None else load(weights), shown_part(low.color)
    notes = list(low.notes)
    images = mirrored(low.color)
    rows, columns = images[part].shape[:2]
    if rows * columns:
        guides = None
        if loaded is not None and loaded.guided and low.guides is not None:
            guides = from_elemental_images(mirrored(low.guides)[part])
        denoised = denoise_eia(from_elemental_images(images[part]), guides, weights=loaded, exposure=low.exposure,
                               device=Wanted.of(low.device, low.gpus), note=notes.append)
        made = to_elemental_images(denoised, (columns, rows))
        before, after = (each.mean((2, 3, 4)) for each in (images[part], made))
        shine, kept = before > 0, (after > LEAST_LEFT * before) & np.isfinite(after)
        lost = (shine & ~kept).sum()
        if weights is not None and Path(weights) != WEIGHTS and lost > MOST_LOST * shine.sum():
            raise LfsrError(f"weights {weights} make {lost} of {shine.sum()} elemental images black or infinite: "
                            "their numbers overflow. Train them again, or use others")
        images[part] = made
    return dataclasses.replace(low, color=mirrored(images), noisy=low.color, notes=tuple(notes))


def denoised_opacity(low: LowResEIA, opacity: Array) -> Array:
    """Denoise the opacity (sy, sx, h, w, 3) in [0, 1] of a low-resolution EIA before a world."""
    alone = dataclasses.replace(low, color=opacity, guides=None, noisy=None, exposure=0.0)
    cleaned = np.clip(denoise_low_resolution(alone).color, 0, 1)
    # A denoiser must not spread opacity into elemental images without any.
    return np.asarray(cleaned * opacity.any((2, 3, 4), keepdims=True))


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
    found = {name: tensor.shape for name, tensor in tensors.items()}
    widths = [found.get(f"{layer}.bias", (0,))[0] for layer in LAYERS]
    widths[-1] = 3
    shapes = network_shapes(widths, inputs)
    for name in sorted(shapes.keys() | found.keys()):
        if found.get(name) != shapes.get(name):
            raise LfsrError(f"{origin} has tensor {name[:40]!r} of shape {found.get(name, 'missing')}, expected "
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
    known = digest = hashlib.sha256(content).hexdigest()
    with contextlib.suppress(LfsrError, LookupError, TypeError):  # a training writes them beside the weights
        known = read_json(facts, "the facts of a training")["sha256"]
    if digest != known:
        raise LfsrError(f"{path} does not have the SHA-256 in {facts.name}: it was changed or damaged, get both again")
    if any(tensor.dtype != np.float16 for tensor in tensors.values()):
        raise LfsrError(f"{path} holds single floats, but Open Image Denoise takes half floats: write them with "
                        "write_tza(half=True)")
    return Weights(content, inputs == GUIDED_INPUTS)


def read_tza(path: str | Path) -> dict[str, Array]:
    """Tensors of a file by name, float32 or float16 as stored; LfsrError where it is damaged or no such file."""
    return parse_tza(read_bytes(path, "TZA weights", MOST_BYTES), path)


def parse_tza(content: bytes, origin: object) -> dict[str, Array]:
    """Tensors of a file's bytes; ``origin`` names them in the LfsrError of damaged ones."""
    try:
        return dict(_entries(content))
    except (ValueError, struct.error) as error:
        raise LfsrError(f"{origin} cannot be read as TZA weights ({error}): get it again or train it again") from None


def write_tza(path: str | Path, tensors: Mapping[str, Array], *, half: bool = True) -> None:
    """Write tensors of one or four axes, whole or not at all, as float16 (``half``) or float32.

    The library takes float16 alone. LfsrError where a value is not finite, which it may become as float16, or where
    there are too many.
    """
    kind = b"h" if half else b"f"
    with np.errstate(over="ignore"):
        stored = {name: np.ascontiguousarray(tensor, TYPES[kind]) for name, tensor in tensors.items()}
    body, table = bytearray(HEADER.size), bytearray(struct.pack("<I", len(stored)))
    for name, tensor in stored.items():
        if tensor.ndim not in LAYOUTS or not np.isfinite(tensor).all():
            raise LfsrError(f"tensor {name!r} of shape {tensor.shape} for {path} has values that are not finite, or "
                            "not 1 or 4 axes: check the training")
        body += bytes(-len(body) % ALIGNMENT)
        table += struct.pack("<H", len(name.encode())) + name.encode()
        table += struct.pack(f"<B{tensor.ndim}I", tensor.ndim, *tensor.shape) + LAYOUTS[tensor.ndim] + kind
        table += struct.pack("<Q", len(body))
        body += tensor.tobytes()
    HEADER.pack_into(body, 0, MAGIC, VERSION, MINOR, len(body))
    if len(body) + len(table) > MOST_BYTES:
        raise LfsrError(f"weights for {path} take {len(body)} bytes, expected at most {MOST_BYTES}: "
                        "use a smaller network")
    with atomic_path(path) as temporary:
        temporary.write_bytes(body + table)


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
