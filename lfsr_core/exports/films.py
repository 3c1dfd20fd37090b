"""Films: MP4 with H.264 or HEVC, GIF, WebP and numbered PNG images; of quilts, and of an eye that moves.

Sway goes round an ellipse, wiggle between two eyes.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.base.notices import Progress
from lfsr_core.exports.images import eye_distance, panel_aspect, quilt_layout, quilt_of_views
from lfsr_core.exports.light_field import LightField, on_screen, usual_width
from lfsr_core.exports.options import (
    FILM_TYPES,
    H264_SIDE,
    QUILT_FILM_TYPES,
    WIGGLE_TYPES,
    ExportOptions,
    chosen_type,
    quilt_name,
)
from lfsr_core.images.png import write_png

QUALITY = 90  # of WebP
ENCODERS = {"libx264": {"crf": "18", "preset": "medium"},  # without visible loss
            "libx265": {"crf": "20", "preset": "fast", "x265-params": "log-level=error"}}
APPLE_TAG = "hvc1"  # of HEVC, without which Apple's programs do not play it
RATES = {"mp4": 30, "gif": 20, "webp": 20, "png": 30}  # frames per second; GIF counts in hundredths of a second
LOOPING = ("gif", "webp")  # start again by themselves
ANIMATION_RATE = 24  # Blender's default
REACH, RISE = 0.85, 0.35  # fraction of the half viewing zone, across and up


class Motion(NamedTuple):
    """How the eye moves."""

    name: str
    types: tuple[str, ...]  # of files, the default first
    seconds: float  # of one round
    rounds: int  # of a film that does not start again by itself
    # place (x, y) of the eye in millimetres, at a phase of the round in [0, 1)
    place: Callable[[LightField, ExportOptions, float], tuple[float, float]]


def eye_place(field: LightField, phase: float) -> tuple[float, float]:
    """Place (x, y) of the swaying eye in millimetres, at ``phase`` in [0, 1)."""
    spacing, (across, down) = field.display.camera_spacing_mm, field.count
    angle = 2 * math.pi * phase
    return (REACH * across / 2 * spacing * math.sin(angle), RISE * down / 2 * spacing * math.cos(angle))


SWAY = Motion("sway", FILM_TYPES, 4.0, 1, lambda field, _, phase: eye_place(field, phase))
WIGGLE = Motion("wiggle", WIGGLE_TYPES, 0.8, 5, lambda field, options, phase:
                (eye_distance(field, options) / 2 * math.sin(2 * math.pi * phase), 0.0))


def write_motion(motion: Motion, fields: Iterator[LightField], count: int | None, folder: Path,
                 options: ExportOptions) -> None:
    """Write the film of ``count`` frames, while the eye moves one or more whole rounds; of one frame for count None."""
    first, chosen = next(fields), chosen_type(options, motion.types)
    if count is None:
        rate: float = options.fps or RATES[chosen]
        rounds = 1 if chosen in LOOPING else motion.rounds
        total = max(2, round((options.seconds or motion.seconds) * rate)) * rounds
        fields = itertools.repeat(first, total)
    else:
        rate, total = options.fps or ANIMATION_RATE, count
        rounds = max(1, round(count / rate / (options.seconds or motion.seconds)))
        fields = itertools.chain([first], fields)

    def frames() -> Iterator[Array]:
        for number, field in enumerate(fields):
            options.tell(Progress("export", number / total, f"frame {number + 1} of {total}"))
            view = field.seen_from(*motion.place(field, options, rounds * number / total % 1))
            yield on_screen(view, field.display, options.width or usual_width(field.display))

    write_film(folder / f"{first.name}_{motion.name}.{chosen}", frames(), rate)


def write_quilt_film(fields: Iterator[LightField], count: int | None, folder: Path, options: ExportOptions) -> None:
    """Write ``count`` quilts as a film, None for one, of even sides, as its encoders need."""
    first = next(fields)
    grid, (width, height) = quilt_layout(first, options)
    tile = width - width * grid[0] % 2, height - height * grid[1] % 2
    name = f"{quilt_name(first.name, grid, panel_aspect(first))}.{chosen_type(options, QUILT_FILM_TYPES)}"

    def quilts() -> Iterator[Array]:
        for number, field in enumerate(itertools.chain([first], fields)):
            options.tell(Progress("export", number / (count or 1), f"frame {number + 1} of {count or 1}"))
            yield quilt_of_views(field, grid, tile)

    write_film(folder / name, quilts(), options.fps or ANIMATION_RATE)


def write_film(path: Path, frames: Iterator[Array], rate: float) -> None:
    """Write frames (H, W, 3) uint8 of one size, with even sides, by the ending of ``path``.

    PNG becomes numbered images, ``stem_0001.png``. LfsrError where the encoder is missing.
    """
    if path.suffix == ".png":
        for number, frame in enumerate(frames, start=1):
            write_png(path.with_name(f"{path.stem}_{number:04d}.png"), frame)
        return
    if path.suffix == ".mp4":
        _write_mp4(path, frames, rate)
        return
    try:
        from PIL import Image
    except ImportError:
        raise LfsrError(f"{path.suffix[1:].upper()} needs the package pillow, which this Python lacks: pip install "
                        "'lfsr[video]', or choose another type") from None
    first, *others = [Image.fromarray(frame) for frame in frames]
    quality: dict[str, Any] = {"quality": QUALITY, "method": 4}
    if path.suffix == ".gif":  # one palette, so that colours do not flicker, and no bands
        palette = first.quantize()
        first, *others = [image.quantize(palette=palette) for image in (first, *others)]
        quality = {"optimize": True}
    first.save(path, save_all=True, append_images=others, duration=round(1000 / rate), loop=0, **quality)


def _write_mp4(path: Path, frames: Iterator[Array], rate: float) -> None:
    try:
        import av
    except ImportError:
        raise LfsrError("MP4 needs the package av, which this Python lacks: pip install 'lfsr[video]', or choose "
                        "type png and encode the frames elsewhere") from None
    first = next(frames)
    encoder = "libx264" if max(first.shape[:2]) <= H264_SIDE else "libx265"
    with av.open(str(path), "w", options={"movflags": "faststart"}) as film:
        try:
            stream: Any = film.add_stream(encoder, rate=Fraction(rate).limit_denominator(1001),
                                          options=ENCODERS[encoder])
        except ValueError:
            raise LfsrError(f"films of {first.shape[1]}×{first.shape[0]} pixels need {encoder}, which this Python's "
                            "package av lacks: choose type png and encode the frames elsewhere") from None
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
