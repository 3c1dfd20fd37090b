"""A short film of an eye that sways in front of the display, as MP4, GIF, WebP or single frames."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

from lfsr_core.arrays import Array
from lfsr_core.errors import LfsrError
from lfsr_core.exports.format_names import FILM_TYPES
from lfsr_core.exports.light_field import LightField
from lfsr_core.exports.options import ExportOptions, chosen_type
from lfsr_core.exports.screen_images import on_screen, usual_width
from lfsr_core.images.png import write_png

SECONDS = 4.0
RATES = {"mp4": 30, "gif": 20, "webp": 20, "png": 30}  # frames per second; GIF counts in hundredths of a second
ANIMATION_RATE = 24  # Blender's default
REACH, RISE = 0.85, 0.35  # fraction of the half viewing zone, across and up
QUALITY = 90  # of WebP
CRF = "18"  # of H.264, without visible loss


def write(field: LightField, folder: Path, options: ExportOptions) -> list[str]:
    """Write the film of one frame, while the eye goes once round an ellipse; return the notes."""
    rate = options.fps or RATES[chosen_type(options, FILM_TYPES)]
    count = max(2, round((options.seconds or SECONDS) * rate))
    return _write(((field, number / count) for number in range(count)), count, rate, folder, options)


def write_film(fields: Iterator[LightField], count: int, folder: Path, options: ExportOptions) -> list[str]:
    """Write the film of ``count`` frames, while the eye goes round one or more whole ellipses; return the notes."""
    rate = options.fps or ANIMATION_RATE
    ellipses = max(1, round(count / rate / (options.seconds or SECONDS)))
    places = ((field, ellipses * number / count % 1) for number, field in enumerate(fields))
    return _write(places, count, rate, folder, options)


def _write(places: Iterable[tuple[LightField, float]], count: int, rate: float, folder: Path,
           options: ExportOptions) -> list[str]:
    """Write ``count`` frames, each the view of a light field from a phase of the ellipse."""
    chosen = chosen_type(options, FILM_TYPES)
    places = iter(places)
    first = next(places)
    frames = _frames(itertools.chain([first], places), count, options)
    path = folder / f"{first[0].name}_sway.{chosen}"
    if chosen == "png":
        for number, frame in enumerate(frames, start=1):
            write_png(path.with_name(f"{path.stem}_{number:04d}.png"), frame)
    elif chosen == "mp4":
        _write_mp4(path, frames, rate)
    else:
        _write_animation(path, frames, rate)
    return []


def eye_place(field: LightField, phase: float) -> tuple[float, float]:
    """Place (x, y) of the eye in millimetres, at ``phase`` in [0, 1)."""
    spacing, (across, down) = field.display.camera_spacing_mm, field.count
    angle = 2 * math.pi * phase
    return (REACH * across / 2 * spacing * math.sin(angle), RISE * down / 2 * spacing * math.cos(angle))


def _frames(places: Iterable[tuple[LightField, float]], count: int, options: ExportOptions) -> Iterator[Array]:
    for number, (field, phase) in enumerate(places):
        options.progress("export", number / count, f"frame {number + 1} of {count}")
        view = field.seen_from(*eye_place(field, phase))
        yield on_screen(view, field.display, options.width or usual_width(field.display))


def _write_mp4(path: Path, frames: Iterator[Array], rate: float) -> None:
    try:
        import av
    except ImportError:
        raise LfsrError("MP4 needs the package av, which this Python lacks: pip install 'lfsr[video]', or choose "
                        "--type png and encode the frames elsewhere") from None
    with av.open(str(path), "w", options={"movflags": "faststart"}) as film:
        first = next(frames)
        stream: Any = film.add_stream("libx264", rate=Fraction(rate).limit_denominator(1001),
                                      options={"crf": CRF, "preset": "medium"})
        stream.height, stream.width = first.shape[:2]
        stream.pix_fmt = "yuv420p"
        # The file says BT.709 of limited range, which players otherwise guess from the size.
        codec = stream.codec_context
        codec.color_primaries = codec.color_trc = codec.colorspace = codec.color_range = 1
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
    quality = {"quality": QUALITY, "method": 4} if path.suffix == ".webp" else {"optimize": True}
    first.save(path, save_all=True, append_images=others, duration=round(1000 / rate), loop=0, **quality)
