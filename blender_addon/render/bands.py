"""Render long images in bands of pixel rows; finished bands are cached, and the next run resumes from them.

A band is a border render of the image. Cycles derives its random numbers from a pixel's place in the full
frame, so the bands together equal the image byte for byte (measured in 5.0, every layer, bands of one row too).
"""

from __future__ import annotations

import dataclasses
import shutil
import time
from pathlib import Path

import bpy

from lfsr_core.images import exr
from lfsr_core.pipeline.pace import Pace, is_worth_storing
from lfsr_core.pipeline.parts import ImageParts, Part, gaps

from ..scene.overrides import overridden
from .output import render_to
from .progress import Progress, heard, part, sample_fraction

WIDEST_TILE = 8192  # Cycles limits the time of a tile, not of an image: a band has to be one tile


def render_in_bands(scene: bpy.types.Scene, rows: Part, path: Path, progress: Progress | None,
                    parts: ImageParts) -> float:
    """Render ``rows`` of the image that ``scene`` is set up for into an EXR file, in bands if it takes long.

    ``parts`` caches finished bands and has those of an earlier run. Returns the seconds of rendering, with
    those of cached bands.
    """
    pace = Pace(scene.render.resolution_x, rows.size, scene.cycles.samples)
    # The same for the trial and for every band: another value would make Cycles build the scene again.
    limit = pace.timeout if pace.width <= WIDEST_TILE else 0.0
    timed = {"time_limit": limit, "use_auto_tile": True, "tile_size": WIDEST_TILE}
    with overridden(scene.cycles, timed):
        image = _Image(scene, rows, path, progress, parts, pace)
        try:
            return image.rendered(parts.stored(pace.rows))
        finally:
            image.band_file.unlink(missing_ok=True)


@dataclasses.dataclass(frozen=True)
class _Image:
    """An image that may take long; its rows are counted from the first of ``asked``."""

    scene: bpy.types.Scene
    asked: Part
    path: Path
    progress: Progress | None
    parts: ImageParts
    pace: Pace

    @property
    def band_file(self) -> Path:
        """File of a band before it is cached."""
        return self.path.with_name("band.exr")

    def rendered(self, cached: list[tuple[Part, Path]]) -> float:
        """Render what is not ``cached`` and write all of the image; seconds of both."""
        if not cached and self.pace.is_short and (done := self._at_once()):
            return done.seconds
        rows = self.pace.rows
        if gaps(rows, (band for band, _ in cached)):
            trial = self._render(self.pace.trial, self.band_file, self._part(cached, 0)).sampling
            if not cached and self.pace.takes_one(trial) and (done := self._at_once()):
                return done.seconds
            rows = self.pace.after(trial)
        return self._in_bands(list(cached), rows)

    def _at_once(self) -> Part | None:
        """Render the image in one go; None if it takes too long."""
        done = self._render(Part(0, self.pace.rows), self.path, self.progress)
        if not done.is_whole:
            self.path.unlink()
            return None
        if self.parts.another_follows and is_worth_storing(done.part.seconds):
            shutil.copyfile(self.path, self.band_file)
            self.parts.store(self.band_file, done.part)
        return done.part

    def _in_bands(self, cached: list[tuple[Part, Path]], rows: int) -> float:
        """Render the missing bands, the first with ``rows`` rows, and join all bands; seconds of all."""
        while missing := gaps(self.pace.rows, (band for band, _ in cached)):
            band = Part(missing[0].first, min(missing[0].last, missing[0].first + rows))
            done = self._band(band, self._part(cached, band.size))
            if done.is_whole:
                cached.append((done.part, self.parts.store(self.band_file, done.part)))
                rows = self.pace.after(done.sampling)
            else:
                rows = self.pace.after_timeout(band)
        started = time.perf_counter()
        half = self.scene.render.image_settings.color_depth == "16"
        exr.join_rows([path for _, path in sorted(cached)], self.path, half=half)
        return sum(band.seconds for band, _ in cached) + time.perf_counter() - started

    def _part(self, cached: list[tuple[Part, Path]], size: int) -> Progress | None:
        """Progress of ``size`` rows after the ``cached`` ones."""
        return part(self.progress, sum(band.size for band, _ in cached), size, self.pace.rows)

    def _band(self, band: Part, progress: Progress | None) -> _Done:
        """Render a band; a single row may take any time."""
        done = self._render(band, self.band_file, progress)
        if done.is_whole or band.size > 1:
            return done
        with overridden(self.scene.cycles, {"time_limit": 0.0}):
            return dataclasses.replace(self._render(band, self.band_file, progress), is_whole=True)

    def _render(self, band: Part, path: Path, progress: Progress | None) -> _Done:
        first = self.asked.first
        shown = border(Part(first + band.first, first + band.last), self.scene.render.resolution_y)
        seen = _Seen()
        with overridden(self.scene.render, shown), heard(seen.look):
            seconds = render_to(self.scene, path, progress)
        is_whole = seen.whole or seconds < self.pace.timeout
        sampling = time.perf_counter() - seen.since if seen.since else seconds
        return _Done(dataclasses.replace(band, seconds=seconds), dataclasses.replace(band, seconds=sampling), is_whole)


@dataclasses.dataclass(frozen=True)
class _Done:
    """A rendered band."""

    part: Part
    sampling: Part  # with the seconds of its samples alone
    is_whole: bool  # whether it has all its samples


def border(band: Part, rows: int) -> dict[str, object]:
    """Return the render settings that render only ``band`` of an image of ``rows`` rows."""
    # Blender counts rows from below and cuts to whole pixels: the middle of a pixel cannot round to its neighbour.
    low = 0.0 if band.last == rows else (rows - band.last + 0.5) / rows
    high = 1.0 if band.first == 0 else (rows - band.first + 0.5) / rows
    return {"use_border": True, "use_crop_to_border": True, "border_min_x": 0.0, "border_max_x": 1.0,
            "border_min_y": low, "border_max_y": high}


@dataclasses.dataclass
class _Seen:
    """What Cycles has reported of a render."""

    since: float = 0.0  # time of its first sample, 0 before that
    whole: bool = False  # whether the last sample is done

    def look(self, statistics: str, *_: object) -> None:
        """Read one of Cycles' statistics lines."""
        fraction = sample_fraction(statistics)
        if fraction is not None:
            self.since = self.since or time.perf_counter()
            self.whole = self.whole or fraction >= 1
