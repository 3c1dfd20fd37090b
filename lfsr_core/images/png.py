"""Image files of 8 bits, and a PNG encoder that uses every core: rows are filtered and deflated in bands.

A deflate stream can be cut at full flushes (RFC 1950, 1951), so the standard library's zlib, which releases the GIL,
compresses bands in parallel. For the EIA of an 8K display this takes 2.4 s; OpenImageIO, on one core, takes 6.4 s.
"""

from __future__ import annotations

import functools
import os
import struct
import zlib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from lfsr_core.base.arrays import Array
from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import atomic_path, reading

SIGNATURE = b"\x89PNG\r\n\x1a\n"
BAND_ROWS = 64
MAX_SIDE, MAX_COMPRESSION = 65536, 1032  # of deflate
CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # by colour type; a palette's index is one
COLOR_TYPES = {1: 0, 3: 2}
ADLER_PRIME = 65521


@contextmanager
def opened(path: str | Path) -> Iterator[oiio.ImageInput | None]:
    """Open an image file inside the block; None where OpenImageIO cannot, whose ``geterror`` then says why.

    A pipe, for which it would wait, is no file.
    """
    source = oiio.ImageInput.open(str(path)) if Path(path).is_file() else None
    try:
        yield source
    finally:
        if source is not None:
            source.close()
        oiio.geterror()  # otherwise the library prints the error when the process ends


@functools.cache
def readable_suffixes() -> frozenset[str]:
    """Return the suffixes, without the point, of the formats that OpenImageIO reads."""
    formats = oiio.get_string_attribute("extension_list").split(";")
    return frozenset(suffix for each in formats for suffix in each.split(":")[1].split(","))


def why_unreadable(path: str | Path) -> str:
    """Return why an image file cannot be read to its end, "" if it can."""
    with opened(path) as source:
        if source is None:
            return oiio.geterror() or "no file"
        pixels = source.read_image(oiio.UNKNOWN)
        return source.geterror() or ("no pixels" if pixels is None else "")


def encode_png(pixels: Array) -> list[bytes]:
    """Encode uint8 (H, W, 3) RGB or (H, W) grey, rows from the top, as a PNG file in pieces."""
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

    with ThreadPoolExecutor(os.cpu_count()) as pool:
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
        if max(width, height) <= MAX_SIDE and bits <= size * 8 * MAX_COMPRESSION:
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
