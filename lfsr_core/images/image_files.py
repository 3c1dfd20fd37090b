"""Image files: EXRs as layers, scene-linear float32 (H, W, C), and images of 8 bits; rows from the top.

PNGs are encoded on every core: a deflate stream can be cut at full flushes (RFC 1950, 1951), so the standard library's
zlib, which releases the GIL, compresses bands of rows in parallel. For the EIA of an 8K display this takes 2.4 s;
OpenImageIO, on one core, takes 6.4 s.
"""

import functools
import os
import struct
import zlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError, Notice
from lfsr_core.base.system import atomic_path, reading, usable_cores

# Names, in lower case, that Blender 4.5, Blender 5.x and this program give the same pass.
PASS_LAYERS = {
    "combined": "color", "color": "color", "": "color", "denoising albedo": "albedo", "albedo": "albedo",
    "denoising normal": "normal", "normal": "normal", "denoising depth": "path", "path": "path",
    "position": "position", "indexob": "index", "object index": "index", "index": "index",
    "env": "environment", "environment": "environment", "noisy image": "noisy"}
LAYER_CHANNELS = {"color": "RGBA", "albedo": "RGB", "normal": "XYZ", "position": "XYZ", "index": "X", "path": "Z",
                  "environment": "RGB", "noisy": "RGBA"}
COLORS = ("color", "noisy")  # other layers' components may be called X, Y, Z or R, G, B
FLOATS, LOSSLESS = ("half", "float"), ("none", "rle", "zips", "zip", "piz")
HALF_MAX = 65504.0
SIDEWAYS = (5, 6, 7, 8)  # EXIF orientations that exchange width and height
MAGIC = b"\x76\x2f\x31\x01"
# Limits against damaged headers, which must not cost memory. Deflate compresses at most 1032 times, and 16-bit floats
# become 32-bit ones.
MAX_COMPRESSION = 2200
MAX_BYTES, MAX_SIDE, MAX_PARTS = 2**35, 65536, 1024
FEW_REPLACED, MOST_REPLACED = 0.01, 0.5  # fractions of an image that are replaced without a note, and with one
Layers = dict[str, Array]
SIGNATURE = b"\x89PNG\r\n\x1a\n"
BAND_ROWS = 64
MOST_DEFLATED = 1032  # times that deflate compresses
CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # by colour type; a palette's index is one
COLOR_TYPES = {1: 0, 3: 2}
ADLER_PRIME = 65521


@contextmanager
def opened(path: str | Path) -> Iterator[oiio.ImageInput | None]:
    """Open an image file inside the block; None where OpenImageIO cannot, whose ``geterror`` then says why.

    None for a pipe too, because OpenImageIO would wait for it.
    """
    source = oiio.ImageInput.open(str(path)) if Path(path).is_file() else None
    try:
        yield source
    finally:
        if source is not None:
            source.close()
        oiio.geterror()  # otherwise the library prints the error when the process ends


def upright(image: Array, spec: oiio.ImageSpec) -> Array:
    """An image (H, W, …) turned and mirrored back as its EXIF orientation says."""
    if (orientation := spec.get_int_attribute("Orientation", 1)) in SIDEWAYS:
        image = image.swapaxes(0, 1)
    return image[::-1 if orientation in (3, 4, 7, 8) else 1, ::-1 if orientation in (2, 3, 6, 7) else 1]


@functools.cache
def readable_suffixes() -> frozenset[str]:
    """Return the suffixes, without the point, of the formats that OpenImageIO reads."""
    formats = oiio.get_string_attribute("extension_list").split(";")
    return frozenset(suffix for entry in formats for suffix in entry.split(":")[1].split(","))


def why_unreadable(path: str | Path) -> str:
    """Return why an image file cannot be read to its end, "" if it can."""
    with opened(path) as source:
        if source is None:
            return oiio.geterror() or "no file"
        pixels = source.read_image(oiio.UNKNOWN)  # which sets the error
        return source.geterror() or ("no pixels" if pixels is None else "")


def read_layers(path: str | Path, without: Collection[str] = ()) -> Layers:
    """Read the layers of a multi-layer EXR as float32 (H, W, C), by name.

    Always "color" (RGBA, premultiplied, scene-linear; alpha 1 if the file has none). If the file has them: "albedo"
    (3), "normal" (3, camera-array space, zero where nothing was hit), "position" (3, world space, scene units), "path"
    (1, length up to what mirrors and clear glass show), "index" (1) and "environment" (3). Reads Blender's files (4.5:
    one part, 5.x: one part per pass) and those of ``write_layers``; ignores other passes, and the layers ``without``.
    LfsrError if the file is missing, truncated, has no colour or lacks a channel of a layer.
    """
    path = Path(path)
    with reading(path, "an EXR image") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise _unreadable(path, "it does not begin like an EXR")
    layers: Layers = {}
    try:
        for columns_of, pixels in _read_parts(path, without):
            for layer, parts in columns_of.items():
                wanted = LAYER_CHANNELS[layer]
                orders = (wanted, wanted[:3], *(() if layer in COLORS else ("RGB", "XYZ")))
                if (order := next((names for names in orders if set(parts) == set(names)), None)) is None:
                    raise _unreadable(path, f"its layer {layer} has the channels {', '.join(sorted(parts))} instead of "
                                            f"{', '.join(wanted[:3])}")
                columns = [parts[component] for component in order]
                in_turn = columns == list(range(columns[0], columns[0] + len(columns)))
                layers.setdefault(layer, np.ascontiguousarray(pixels[..., columns[0]:columns[-1] + 1]) if in_turn
                                  else pixels[..., columns])
    except (UnicodeDecodeError, MemoryError) as error:
        raise _unreadable(path, "too little memory" if isinstance(error, MemoryError) else str(error)) from None
    if "color" not in layers:
        raise LfsrError(f"{path} has no colour layer, expected channels R, G, B: render the frame again")
    for layer, pixels in layers.items():
        height, width, channels = pixels.shape
        if (height, width) != layers["color"].shape[:2] or channels not in (len(LAYER_CHANNELS[layer]), 3):
            raise _unreadable(path, f"its layer {layer} has {width}×{height} pixels of {channels} channels")
    if "noisy" in layers:  # then Cycles has denoised the combined pass
        layers["color"] = np.concatenate([layers.pop("noisy")[..., :3], layers["color"][..., 3:]], axis=2)
    if layers["color"].shape[2] == 3:
        layers["color"] = np.concatenate([layers["color"], np.ones_like(layers["color"][..., :1])], axis=2)
    return layers


def write_layers(path: str | Path, layers: Mapping[str, Array], half: bool = False) -> None:
    """Write layers, (H, W, C) each, as one EXR part with the channels R, G, B, A, albedo.R, ...

    ``half`` stores 16-bit floats, clipped to their range. "color" may have three
    or four channels. LfsrError if the file cannot be written; then no partial file is left.
    """
    pixels = _stacked(layers, half)
    with _output(path, layers, len(pixels), half) as output:
        _check_written(path, output, output.write_image(pixels))


def join_rows(paths: Sequence[str | Path], path: str | Path, half: bool = False) -> None:
    """Join EXR files below each other, from the top, and write the result to ``path`` as ``write_layers`` does.

    Only one file is in memory at a time. LfsrError if one cannot be read, has other layers or another width,
    or if the result cannot be written.
    """
    rows = sum(size(part)[1] for part in paths)
    first, at = read_layers(paths[0]), 0
    with _output(path, first, rows, half) as output:
        for part in paths:
            layers = read_layers(part) if at else first
            if set(layers) != set(first) or layers["color"].shape[1] != first["color"].shape[1]:
                raise _unreadable(Path(part), "it has other layers or another width than the part above it")
            # The order of layers differs between Blender's files and ours.
            layers = {name: layers[name] for name in first}
            below = at + layers["color"].shape[0]
            _check_written(path, output, output.write_scanlines(at, below, 0, _stacked(layers, half)))
            at = below


def size(path: str | Path) -> tuple[int, int]:
    """Width and height in pixels, from the file's header; LfsrError if it cannot be read."""
    with reading(path, "an EXR image"), opened(path) as source:
        if source is None:
            raise _unreadable(Path(path), oiio.geterror())
        return source.spec().width, source.spec().height


def _stacked(layers: Mapping[str, Array], half: bool) -> Array:
    pixels = np.concatenate([np.asarray(layer, np.float32) for layer in layers.values()], axis=2)
    return np.clip(pixels, -HALF_MAX, HALF_MAX) if half else pixels


@contextmanager
def _output(path: str | Path, layers: Mapping[str, Array], height: int, half: bool) -> Iterator[oiio.ImageOutput]:
    """An open EXR for these layers with ``height`` rows."""
    names: list[str] = []
    for layer, pixels in layers.items():
        if layer not in LAYER_CHANNELS:
            raise LfsrError(f"layer is {layer!r}, but it must be one of {', '.join(LAYER_CHANNELS)}")
        prefix = "" if layer == "color" else f"{layer}."
        names += [prefix + component for component in LAYER_CHANNELS[layer][:pixels.shape[2]]]
    spec = oiio.ImageSpec(next(iter(layers.values())).shape[1], height, len(names), "half" if half else "float")
    spec.channelnames = tuple(names)
    spec.attribute("compression", "zip")
    spec.attribute("DateTime", "")  # so that equal images are equal files, whenever they were written
    with atomic_path(path) as temporary:
        output = oiio.ImageOutput.create(str(temporary))
        _check_written(path, output, output.open(str(temporary), spec))
        try:
            yield output
        finally:  # Windows removes no open file
            closed = output.close()
        _check_written(path, output, closed)
        check_complete(temporary, path)  # closing does not tell that the last rows found no space


def _check_written(path: str | Path, output: oiio.ImageOutput, done: bool) -> None:
    if not done:
        raise LfsrError(f"{path} cannot be written ({output.geterror().strip()}): free some space or "
                        "choose another folder")


def check_complete(path: str | Path, named: str | Path | None = None) -> None:
    """LfsrError unless every part of an EXR can be read to its last row; a full disk truncates files silently.

    ``named``: the file's name in the error, None for ``path``.
    """
    with reading(path, "an EXR image"), opened(path) as source:
        index, reason = 0, oiio.geterror() if source is None else None
        while source is not None and reason is None and source.seek_subimage(index, 0):
            pixels = source.read_image(index, 0, 0, source.spec().nchannels, "half")
            reason = source.geterror() if pixels is None or source.has_error else None
            index += 1
    if reason is not None:
        line = next(iter(reason.strip().splitlines()), "it has no pixels")
        raise LfsrError(f"{named or path} was not written completely ({line}): free some space or choose another "
                        "folder")


def clean(layers: Mapping[str, Array]) -> tuple[Layers, int]:
    """Replace every NaN and infinity by 0; return the layers and the number of pixels that had one."""
    cleaned, broken = dict(layers), None
    for name, pixels in layers.items():
        # The sum of finite pixels is finite: one pass over healthy layers, without a temporary.
        with np.errstate(invalid="ignore"):
            healthy = np.isfinite(np.sum(pixels, dtype=np.float64))
        if healthy:
            continue
        bad = ~np.isfinite(pixels)
        cleaned[name] = np.where(bad, np.float32(0), pixels)
        broken = bad.any(-1) if broken is None else broken | bad.any(-1)
    return cleaned, 0 if broken is None else int(broken.sum())


def read_finite(path: str | Path, without: Collection[str] = ()) -> tuple[Layers, int]:
    """Return ``clean`` of ``read_layers``; LfsrError, besides its own, where most pixels are not finite."""
    layers, replaced = clean(read_layers(path, without))
    pixels = layers["color"][..., 0].size
    if replaced > MOST_REPLACED * pixels:
        raise LfsrError(f"{path} has {replaced} of {pixels} pixels that are not finite: find the material or light "
                        "that makes them, and render it again")
    return layers, replaced


def replaced_notices(replaced: int, pixels: int) -> list[Notice]:
    """Return a notice if more than a few of an image's ``pixels`` were ``replaced``."""
    few = replaced <= FEW_REPLACED * pixels
    return [] if few else [Notice("pixels-replaced", {"replaced": replaced, "pixels": pixels})]


def _read_parts(path: Path, without: Collection[str]) -> Iterator[tuple[dict[str, dict[str, int]], Array]]:
    """(``_layer_columns``, (H, W, C) float32) of every part of the file that has a layer not in ``without``."""
    with opened(path) as source:
        if source is None:
            raise _unreadable(path, oiio.geterror())
        index, left = 0, min(MAX_BYTES, path.stat().st_size * MAX_COMPRESSION)
        while source.seek_subimage(index, 0):
            spec = source.spec()
            width, height = max(spec.width, spec.tile_width), max(spec.height, spec.tile_height)
            left -= width * height * max(spec.depth, spec.tile_depth, 1) * spec.nchannels * 4
            if (left < 0 or index >= MAX_PARTS or spec.deep or max(width, height) > MAX_SIDE
                    or min(spec.width, spec.height) < 1):
                raise _unreadable(path, "its header asks for more than the file can hold")
            if (compression := spec.get_string_attribute("compression", "none")) not in LOSSLESS:
                raise _unreadable(path, f"its compression is {compression}, expected one without loss, as zip")
            names = spec.channelnames
            wanted = {layer: columns for layer, columns in _layer_columns(names).items() if layer not in without}
            for layer, columns in wanted.items():  # whole numbers are read as fractions of the largest
                for kind in {str(spec.channelformat(column)) for column in columns.values()}.difference(FLOATS):
                    raise _unreadable(path, f"its layer {layer} has {kind} numbers instead of floats")
            pixels = source.read_image(index, 0, 0, len(names), "float") if wanted else None
            if source.has_error:
                raise _unreadable(path, source.geterror())
            if pixels is not None:
                yield wanted, pixels.reshape(*pixels.shape[:2], len(names))
            index += 1


def _unreadable(path: Path, reason: str) -> LfsrError:
    line = next(iter(reason.strip().splitlines()), "unknown format")
    return LfsrError(f"{path} cannot be read ({line}): the file is damaged or not an EXR, render it again")


def _layer_columns(names: Sequence[str]) -> dict[str, dict[str, int]]:
    """Column of each component of each layer among channels such as ``ViewLayer.Denoising Albedo.R``."""
    columns: dict[str, dict[str, int]] = {}
    for column, name in enumerate(names):
        *parents, component = name.split(".")
        if layer := PASS_LAYERS.get(parents[-1].lower() if parents else ""):
            # A second view layer's pass of the same name does not replace the first one's.
            columns.setdefault(layer, {}).setdefault(component, column)
    return columns


def encode_png(pixels: Array) -> list[bytes]:
    """Encode uint8 (H, W, 3) RGB or (H, W) grey, rows from the top, as a PNG file in pieces."""
    if pixels.dtype != np.uint8 or pixels.ndim not in (2, 3) or pixels.shape[2:] not in ((), (1,), (3,)):
        raise LfsrError(f"pixels are {pixels.dtype} of shape {pixels.shape}, expected uint8 of (rows, columns) or "
                        "(rows, columns, 3): convert them")
    rows = np.ascontiguousarray(pixels).reshape(pixels.shape[0], -1)
    channels = rows.shape[1] // pixels.shape[1]
    header = struct.pack(">IIBBBBB", pixels.shape[1], pixels.shape[0], 8, COLOR_TYPES[channels], 0, 0, 0)

    def deflated(start: int) -> tuple[bytes, int, int]:
        """Compressed bytes, Adler-32 and length of the filtered rows of the band from ``start`` on."""
        band = rows[start:start + BAND_ROWS]
        filtered = np.empty((len(band), band.shape[1] + 1), np.uint8)
        filtered[:, 0] = 2  # "Up": each row minus the one above
        np.subtract(band[1:], band[:-1], out=filtered[1:, 1:])
        filtered[0, 1:] = band[0] - rows[start - 1] if start else band[0]
        # On rendered images run lengths alone compress as well as full matching, twice as fast.
        deflate = zlib.compressobj(1, zlib.DEFLATED, -15, 9, zlib.Z_RLE)
        data = deflate.compress(filtered.data) + deflate.flush(zlib.Z_FULL_FLUSH)
        return data, zlib.adler32(filtered.data), filtered.size

    with ThreadPoolExecutor(usable_cores()) as pool:
        bands = list(pool.map(deflated, range(0, len(rows), BAND_ROWS)))
    checksum = 1
    for _, band_checksum, length in bands:  # as zlib's adler32_combine
        low = (checksum & 0xFFFF) + (band_checksum & 0xFFFF) - 1
        high = (checksum >> 16) + (band_checksum >> 16) + (length % ADLER_PRIME) * ((checksum & 0xFFFF) - 1)
        checksum = (high % ADLER_PRIME) << 16 | low % ADLER_PRIME
    # An empty final block ends the stream. 78 01: zlib, 32 KiB window, fastest.
    tail = b"\x03\x00" + struct.pack(">I", checksum)
    data = [_chunk(b"IDAT", band) for band, _, _ in bands]
    return [SIGNATURE, _chunk(b"IHDR", header), _chunk(b"IDAT", b"\x78\x01"), *data,
            _chunk(b"IDAT", tail), _chunk(b"IEND", b"")]


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(data, zlib.crc32(kind)))


def write_png(path: str | Path, pixels: Array) -> None:
    """Write uint8 (H, W, 3) RGB or (H, W) grey; LfsrError if that fails, and then no partial file is left."""
    encoded = encode_png(pixels)
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        for part in encoded:
            file.write(part)


def read_png(path: str | Path, grey: bool = False) -> Array:
    """Read an 8-bit image as uint8 (H, W, 3) RGB, or its first channel (H, W); LfsrError if it cannot be read."""
    with reading(path, "a PNG image") as file:
        head, size, pixels = file.read(26), file.seek(0, os.SEEK_END), None
    if len(head) == 26 and head.startswith(SIGNATURE):
        width, height, depth, color_type = struct.unpack(">IIBB", head[16:])
        bits = width * height * depth * CHANNELS.get(color_type, 4)
        # Damaged headers must not cost memory: the file must be able to hold an image as large as its head states.
        if max(width, height) <= MAX_SIDE and bits <= size * 8 * MOST_DEFLATED:
            with opened(path) as source:
                pixels = source.read_image("uint8") if source else None
    if pixels is None:
        raise LfsrError(f"{path} is not a readable 8-bit image: write it again")
    pixels = pixels.reshape(*pixels.shape[:2], -1)
    if grey:
        return pixels[..., 0]
    return np.ascontiguousarray(pixels[..., :3]) if pixels.shape[2] >= 3 else pixels[..., :1].repeat(3, axis=2)


def write_mask(path: str | Path, mask: Array) -> None:
    """Write a boolean (rows, columns) mask as a black-and-white PNG, one pixel per entry."""
    write_png(path, np.where(mask, np.uint8(255), np.uint8(0)))


def read_mask(path: str | Path, lenses: tuple[int, int] | None = None) -> Array:
    """Read a boolean (rows, columns) mask that ``write_mask`` wrote; LfsrError unless it has the size ``lenses``."""
    mask = np.asarray(read_png(path, grey=True) >= 128)
    if lenses and mask.shape[::-1] != tuple(lenses):
        raise LfsrError(f"{path} has {mask.shape[1]}×{mask.shape[0]} pixels, but the display has "
                        f"{lenses[0]}×{lenses[1]} lenses: upscale the folder again")
    return mask
