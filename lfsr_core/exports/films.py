"""Write films: MP4 with H.264 or HEVC, GIF, WebP, and numbered PNG images."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.exports.format_names import H264_SIDE
from lfsr_core.images.png import write_png

QUALITY = 90  # of WebP
ENCODERS = {"libx264": {"crf": "18", "preset": "medium"},  # without visible loss
            "libx265": {"crf": "20", "preset": "fast", "x265-params": "log-level=error"}}
APPLE_TAG = "hvc1"  # of HEVC, without which Apple's programs do not play it


def write_film(path: Path, frames: Iterator[Array], rate: float) -> None:
    """Write frames (H, W, 3) uint8 of one size, with even sides, by the ending of ``path``.

    PNG becomes numbered images, ``stem_0001.png``. LfsrError where the encoder is missing.
    """
    if path.suffix == ".png":
        for number, frame in enumerate(frames, start=1):
            write_png(path.with_name(f"{path.stem}_{number:04d}.png"), frame)
    elif path.suffix == ".mp4":
        _write_mp4(path, frames, rate)
    else:
        _write_animation(path, frames, rate)


def _write_mp4(path: Path, frames: Iterator[Array], rate: float) -> None:
    try:
        import av
    except ImportError:
        raise LfsrError("MP4 needs the package av, which this Python lacks: pip install 'lfsr[video]', or choose "
                        "--type png and encode the frames elsewhere") from None
    first = next(frames)
    encoder = "libx264" if max(first.shape[:2]) <= H264_SIDE else "libx265"
    with av.open(str(path), "w", options={"movflags": "faststart"}) as film:
        try:
            stream: Any = film.add_stream(encoder, rate=Fraction(rate).limit_denominator(1001),
                                          options=ENCODERS[encoder])
        except ValueError:
            raise LfsrError(f"films of {first.shape[1]}×{first.shape[0]} pixels need {encoder}, which this Python's "
                            "package av lacks: choose --type png and encode the frames elsewhere") from None
        stream.height, stream.width = first.shape[:2]
        stream.pix_fmt = "yuv420p"
        # The file says BT.709 of limited range, which players otherwise guess from the size.
        codec = stream.codec_context
        codec.color_primaries = codec.color_trc = codec.colorspace = codec.color_range = 1
        if encoder == "libx265":
            codec.codec_tag = APPLE_TAG
        for pixels in itertools.chain([first], frames):
            film.mux(stream.encode(av.VideoFrame.from_ndarray(pixels, format="rgb24").reformat(
                format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG")))
        film.mux(stream.encode())


def _write_animation(path: Path, frames: Iterator[Array], rate: float) -> None:
    try:
        from PIL import Image
    except ImportError:
        raise LfsrError(f"{path.suffix[1:].upper()} needs the package pillow, which this Python lacks: pip install "
                        "'lfsr[video]', or choose another --type") from None
    first, *others = [Image.fromarray(frame) for frame in frames]
    quality: dict[str, Any] = {"quality": QUALITY, "method": 4}
    if path.suffix == ".gif":  # one palette, so that colours do not flicker, and no bands
        palette = first.quantize()
        first, *others = [image.quantize(palette=palette) for image in (first, *others)]
        quality = {"optimize": True}
    first.save(path, save_all=True, append_images=others, duration=round(1000 / rate), loop=0, **quality)
