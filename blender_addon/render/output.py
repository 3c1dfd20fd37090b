"""Render a scene into a file, whole or not at all; in bands of pixel rows where it takes long.

Finished bands are cached, and the next run resumes from them. A band is a border render of the image. Cycles derives
its random numbers from a pixel's place in the full frame, so the bands together equal the image byte for byte (measured
in 5.0, every layer, bands of one row too).
"""

import dataclasses
import re
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import atomic_path, lock_file
from lfsr_core.images import image_files
from lfsr_core.pipeline.parts import ImageParts, Pace, Part, gaps, is_worth_storing

from .. import compat
from ..compat import overridden

# Called with the fraction of an image that is done and what Cycles does; an exception that it raises cancels.
Follow = Callable[[float, str], None]
WIDEST_TILE = 8192  # Cycles limits the time of a tile, not of an image: a band has to be one tile
# Files and folders that a render is writing now; a process that must end at once removes them.
UNFINISHED: set[Path] = set()
NUMBERS = ("Mem:", "Remaining:", "Time:", "Fra:", "Peak:")  # of Cycles' statistics, besides what it does
_SAMPLES = re.compile(r"(?:Rendered (\d+)/(\d+) Tiles, )?Sample (\d+)/(\d+)")


def render_to(scene: bpy.types.Scene, path: str | Path, follow: Follow | None = None) -> float:
    """Render the scene as it is set up now into ``path``, whole or not at all, and return the seconds.

    Python cannot stop Cycles: if ``follow`` raises an exception, Cycles ends its image first; then this function raises
    the exception, even a KeyboardInterrupt, which Blender would swallow.
    """
    started, stopped, last = time.perf_counter(), list[BaseException](), (0.0, "")

    def listen(statistics: str, *_: object) -> None:
        nonlocal last
        before, fraction = last, sample_fraction(statistics)
        parts = [part.strip() for part in statistics.split("|")]
        doing = ": ".join(part for part in parts if not part.startswith(NUMBERS))
        last = before[0] if fraction is None else fraction, doing
        if follow and not stopped and last[1] != before[1]:
            try:
                follow(*last)
            except BaseException as error:
                stopped.append(error)

    with unfinished(path) as temporary, overridden(scene.render, {"filepath": compat.literal_path(str(temporary))}):
        try:
            with heard(listen):
                bpy.ops.render.render(write_still=True, scene=scene.name)
        except RuntimeError as error:
            raise LfsrError(f"Blender cannot render this scene ({str(error).strip()}): see its messages") from None
        if stopped:
            raise stopped[0]
        if not temporary.is_file():
            raise LfsrError(f"Blender wrote no image for {path}: see its messages")
        image_files.check_complete(temporary)
    return time.perf_counter() - started


@contextmanager
def heard(listener: Callable[..., None]) -> Iterator[None]:
    """Call ``listener`` with each of Cycles' statistics lines, and more, inside the block."""
    bpy.app.handlers.render_stats.append(listener)
    try:
        yield
    finally:
        bpy.app.handlers.render_stats.remove(listener)


def sample_fraction(statistics: str) -> float | None:
    """Return the fraction of the image that is done from Cycles' statistics line, None if the line has none."""
    if (numbers := _SAMPLES.search(statistics)) is None:
        return None
    tile, tiles = int(numbers[1] or 0), int(numbers[2] or 1)
    return min(1.0, (tile + int(numbers[3]) / max(1, int(numbers[4]))) / tiles)


def part_of(follow: Follow | None, first: int, size: int, count: int, prefix: str = "") -> Follow | None:
    """Return a ``Follow`` for ``size`` steps from ``first`` (from 0), which tells fractions of all ``count`` steps."""
    return follow and (lambda fraction, message: follow((first + fraction * size) / count, prefix + message))


def one_of(follow: Follow | None, index: int, count: int) -> Follow | None:
    """Return a ``Follow`` for image ``index`` (from 0) of ``count`` images, which it numbers in its messages."""
    return part_of(follow, index, 1, count, f"{index + 1}/{count}: " if count > 1 else "")


@contextmanager
def unfinished(path: str | Path) -> Iterator[Path]:
    """As ``atomic_path``; the temporary file and its lock are listed in UNFINISHED inside the block."""
    with atomic_path(path) as temporary, listed(temporary), listed(lock_file(temporary)):
        yield temporary


@contextmanager
def listed(path: Path) -> Iterator[None]:
    """List ``path`` in UNFINISHED inside the block."""
    UNFINISHED.add(path)
    try:
        yield
    finally:
        UNFINISHED.discard(path)


def render_in_bands(scene: bpy.types.Scene, rows: Part, path: Path, follow: Follow | None, parts: ImageParts) -> float:
    """Render ``rows`` of the image that ``scene`` is set up for into an EXR file, in bands if it takes long.

    ``parts`` caches finished bands and has those of an earlier run. Returns the seconds of rendering, with
    those of cached bands.
    """
    pace, band_file = Pace(scene.render.resolution_x, rows.size, scene.cycles.samples), path.with_name("band.exr")

    def render(band: Part, target: Path, size: int) -> tuple[Part, Part, bool]:
        """Render a band, counted from the first of ``rows``, as ``size`` rows after the cached ones.

        Returns the band with its seconds, with those of its samples alone, and whether all samples were taken.
        """
        began, is_whole = 0.0, False  # began: time of the first sample

        def listen(statistics: str, *_: object) -> None:
            nonlocal began, is_whole
            if (fraction := sample_fraction(statistics)) is not None:
                began, is_whole = began or time.perf_counter(), is_whole or fraction >= 1

        followed = part_of(follow, sum(part.size for part, _ in cached), size, pace.rows)
        shown = border(Part(rows.first + band.first, rows.first + band.last), scene.render.resolution_y)
        with overridden(scene.render, shown), heard(listen):
            seconds = render_to(scene, target, followed)
        sampling = time.perf_counter() - began if began else seconds
        return (dataclasses.replace(band, seconds=seconds), dataclasses.replace(band, seconds=sampling),
                is_whole or seconds < pace.timeout)

    def at_once() -> float | None:
        """Render the image in one go; None if it takes too long."""
        done, _, is_whole = render(Part(0, pace.rows), path, pace.rows)
        if not is_whole:
            path.unlink()
            return None
        if parts.another_follows and is_worth_storing(done.seconds):
            shutil.copyfile(path, band_file)
            parts.store(band_file, done)
        return done.seconds

    cached, count = parts.stored(pace.rows), pace.rows
    # The same for the trial and for every band: another value would make Cycles build the scene again.
    limit = pace.timeout if pace.width <= WIDEST_TILE else 0.0
    try:
        with overridden(scene.cycles, {"time_limit": limit, "use_auto_tile": True, "tile_size": WIDEST_TILE}):
            if not cached and pace.is_short and (seconds := at_once()) is not None:
                return seconds
            if gaps(pace.rows, (band for band, _ in cached)):
                _, trial, _ = render(pace.trial, band_file, 0)
                if not cached and pace.takes_one(trial) and (seconds := at_once()) is not None:
                    return seconds
                count = pace.after(trial)
            while missing := gaps(pace.rows, (band for band, _ in cached)):
                band = Part(missing[0].first, min(missing[0].last, missing[0].first + count))
                done, sampling, is_whole = render(band, band_file, band.size)
                if not is_whole and band.size == 1:  # a single row may take any time
                    with overridden(scene.cycles, {"time_limit": 0.0}):
                        done, sampling, _ = render(band, band_file, 1)
                    is_whole = True
                if is_whole:
                    cached.append((done, parts.store(band_file, done)))
                count = pace.after(sampling) if is_whole else pace.after_timeout(band)
        started = time.perf_counter()
        image_files.join_rows([path for _, path in sorted(cached)], path,
                      half=scene.render.image_settings.color_depth == "16")
        return sum(band.seconds for band, _ in cached) + time.perf_counter() - started
    finally:
        band_file.unlink(missing_ok=True)


def border(band: Part, rows: int) -> dict[str, object]:
    """Return the render settings that render only ``band`` of an image of ``rows`` rows."""
    # Blender counts rows from below and cuts to whole pixels: the middle of a pixel cannot round to its neighbour.
    low = 0.0 if band.last == rows else (rows - band.last + 0.5) / rows
    return {"use_border": True, "use_crop_to_border": True, "border_min_x": 0.0, "border_max_x": 1.0,
            "border_min_y": low, "border_max_y": 1.0 if band.first == 0 else (rows - band.first + 0.5) / rows}
