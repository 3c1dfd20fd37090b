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
from lfsr_core.pipeline.staging import ImageParts, Pace, Part, gaps, is_worth_storing

from ..scene.overrides import overridden
from .output import Follow, heard, part_of, render_to, sample_fraction

WIDEST_TILE = 8192  # Cycles limits the time of a tile, not of an image: a band has to be one tile


def render_in_bands(scene: bpy.types.Scene, rows: Part, path: Path, follow: Follow | None, parts: ImageParts) -> float:
    """Render ``rows`` of the image that ``scene`` is set up for into an EXR file, in bands if it takes long.

    ``parts`` caches finished bands and has those of an earlier run. Returns the seconds of rendering, with
    those of cached bands.
    """
    pace = Pace(scene.render.resolution_x, rows.size, scene.cycles.samples)
    # The same for the trial and for every band: another value would make Cycles build the scene again.
    limit = pace.timeout if pace.width <= WIDEST_TILE else 0.0
    with overridden(scene.cycles, {"time_limit": limit, "use_auto_tile": True, "tile_size": WIDEST_TILE}):
        image = _Image(scene, rows, path, follow, parts, pace)
        try:
            return image.rendered(parts.stored(pace.rows))
        finally:
            image.band_file.unlink(missing_ok=True)


@dataclasses.dataclass(frozen=True)
class _Done:
    """A rendered band."""

    part: Part
    sampling: Part  # with the seconds of its samples alone
    is_whole: bool  # whether it has all its samples


@dataclasses.dataclass(frozen=True)
class _Image:
    """An image that may take long; its rows are counted from the first of ``asked``."""

    scene: bpy.types.Scene
    asked: Part
    path: Path
    follow: Follow | None
    parts: ImageParts
    pace: Pace

    @property
    def band_file(self) -> Path:
        """File of a band before it is cached."""
        return self.path.with_name("band.exr")

    def rendered(self, cached: list[tuple[Part, Path]]) -> float:
        """Render what is not ``cached`` and write all of the image; seconds of both."""
        pace, rows = self.pace, self.pace.rows
        if not cached and pace.is_short and (done := self._at_once()):
            return done.seconds
        if gaps(rows, (band for band, _ in cached)):
            trial = self._render(pace.trial, self.band_file, self._followed(cached, 0)).sampling
            if not cached and pace.takes_one(trial) and (done := self._at_once()):
                return done.seconds
            rows = pace.after(trial)
        while missing := gaps(pace.rows, (band for band, _ in cached)):
            band = Part(missing[0].first, min(missing[0].last, missing[0].first + rows))
            follow = self._followed(cached, band.size)
            result = self._render(band, self.band_file, follow)
            if not result.is_whole and band.size == 1:  # a single row may take any time
                with overridden(self.scene.cycles, {"time_limit": 0.0}):
                    result = dataclasses.replace(self._render(band, self.band_file, follow), is_whole=True)
            if result.is_whole:
                cached.append((result.part, self.parts.store(self.band_file, result.part)))
            rows = pace.after(result.sampling) if result.is_whole else pace.after_timeout(band)
        started = time.perf_counter()
        exr.join_rows([path for _, path in sorted(cached)], self.path,
                      half=self.scene.render.image_settings.color_depth == "16")
        return sum(band.seconds for band, _ in cached) + time.perf_counter() - started

    def _at_once(self) -> Part | None:
        """Render the image in one go; None if it takes too long."""
        done = self._render(Part(0, self.pace.rows), self.path, self.follow)
        if not done.is_whole:
            self.path.unlink()
            return None
        if self.parts.another_follows and is_worth_storing(done.part.seconds):
            shutil.copyfile(self.path, self.band_file)
            self.parts.store(self.band_file, done.part)
        return done.part

    def _followed(self, cached: list[tuple[Part, Path]], size: int) -> Follow | None:
        """Progress of ``size`` rows after the ``cached`` ones."""
        return part_of(self.follow, sum(band.size for band, _ in cached), size, self.pace.rows)

    def _render(self, band: Part, path: Path, follow: Follow | None) -> _Done:
        first, began, is_whole = self.asked.first, 0.0, False  # began: time of the first sample

        def listen(statistics: str, *_: object) -> None:
            nonlocal began, is_whole
            fraction = sample_fraction(statistics)
            if fraction is not None:
                began, is_whole = began or time.perf_counter(), is_whole or fraction >= 1

        shown = border(Part(first + band.first, first + band.last), self.scene.render.resolution_y)
        with overridden(self.scene.render, shown), heard(listen):
            seconds = render_to(self.scene, path, follow)
        sampling = time.perf_counter() - began if began else seconds
        return _Done(dataclasses.replace(band, seconds=seconds), dataclasses.replace(band, seconds=sampling),
                     is_whole or seconds < self.pace.timeout)


def border(band: Part, rows: int) -> dict[str, object]:
    """Return the render settings that render only ``band`` of an image of ``rows`` rows."""
    # Blender counts rows from below and cuts to whole pixels: the middle of a pixel cannot round to its neighbour.
    low = 0.0 if band.last == rows else (rows - band.last + 0.5) / rows
    high = 1.0 if band.first == 0 else (rows - band.first + 0.5) / rows
    return {"use_border": True, "use_crop_to_border": True, "border_min_x": 0.0, "border_max_x": 1.0,
            "border_min_y": low, "border_max_y": high}
