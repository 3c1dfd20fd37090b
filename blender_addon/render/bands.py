"""Long renders in bands of pixel rows, whatever the camera: what is whole is kept, and a next run goes on from it.

A band is the image's own border render. Cycles draws its random numbers by a pixel's place in the full frame, so that
bands below each other are the image to the byte (measured in 5.0, every layer, bands of one row too).
"""

from __future__ import annotations

import dataclasses
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

from lfsr_core.images import exr
from lfsr_core.render.pace import Pace, is_worth_keeping
from lfsr_core.render.parts import ImageParts, Part, gaps

from .overrides import overridden
from .progress import Progress, sample_fraction, share

WIDEST_TILE = 8192  # Cycles times tiles, not images: a band has to be one tile
# Renders the scene as it is set up into a file; seconds.
Render = Callable[[Path, Progress | None], float]


@dataclasses.dataclass(frozen=True)
class Target:
    """What is to be rendered, and where to."""

    scene: bpy.types.Scene  # set up for the image
    rows: Part  # of the image, all or some
    path: Path  # EXR to write


def render_in_bands(render: Render, target: Target, progress: Progress | None, parts: ImageParts) -> float:
    """Render an image, or some of its rows, in bands if it takes long.

    Parameters
    ----------
    render : renders the part of the image inside the border that is set into a file
    target : the image
    progress : of all that is to be rendered
    parts : keeps bands that are whole, and has those of an earlier run

    Returns
    -------
    Seconds it took, those of kept bands too.
    """
    scene = target.scene
    pace = Pace(scene.render.resolution_x, target.rows.size, scene.cycles.samples)
    with overridden(scene.cycles, _timed(pace)):
        image = _Image(render, target, progress, pace, parts)
        try:
            return image.rendered(parts.kept(pace.rows))
        finally:
            image.band_file.unlink(missing_ok=True)


def _timed(pace: Pace) -> dict[str, object]:
    """The same for the trial and for every band: another value would make Cycles build the scene again."""
    limit = pace.timeout if pace.width <= WIDEST_TILE else 0.0
    return {"time_limit": limit, "use_auto_tile": True, "tile_size": WIDEST_TILE}


@dataclasses.dataclass(frozen=True)
class _Image:
    """One image that may take long; its rows are counted from the first that is asked for."""

    render: Render
    target: Target
    progress: Progress | None
    pace: Pace
    parts: ImageParts

    @property
    def path(self) -> Path:
        """Where it goes."""
        return self.target.path

    @property
    def scene(self) -> bpy.types.Scene:
        """Set up for it."""
        return self.target.scene

    @property
    def band_file(self) -> Path:
        """Where a band lies until it is kept."""
        return self.path.with_name("band.exr")

    def rendered(self, kept: list[tuple[Part, Path]]) -> float:
        """All of the image, with what is ``kept`` already; seconds of both."""
        if not kept and self.pace.is_short and (done := self._at_once()):
            return done.seconds
        rows = self.pace.rows
        if gaps(rows, (part for part, _ in kept)):
            before = sum(part.size for part, _ in kept)
            trial = self._render(self.pace.trial, self.band_file, share(self.progress, before, 0, rows)).sampling
            if not kept and self.pace.takes_one(trial) and (done := self._at_once()):
                return done.seconds
            rows = self.pace.after(trial)
        return self._in_bands(list(kept), rows)

    def _at_once(self) -> Part | None:
        """The whole image; None where it takes too long."""
        done = self._render(Part(0, self.pace.rows), self.path, self.progress)
        if not done.is_whole:
            self.path.unlink()
            return None
        if self.parts.another_follows and is_worth_keeping(done.part.seconds):
            shutil.copyfile(self.path, self.band_file)
            self.parts.keep(self.band_file, done.part)
        return done.part

    def _in_bands(self, kept: list[tuple[Part, Path]], rows: int) -> float:
        """What is missing, band by band, the first of ``rows`` rows; then all of them as one image. Seconds."""
        while missing := gaps(self.pace.rows, (part for part, _ in kept)):
            band = Part(missing[0].first, min(missing[0].last, missing[0].first + rows))
            before = sum(part.size for part, _ in kept)
            done = self._band(band, share(self.progress, before, band.size, self.pace.rows))
            if done.is_whole:
                kept.append((done.part, self.parts.keep(self.band_file, done.part)))
                rows = self.pace.after(done.sampling)
            else:
                rows = self.pace.after_timeout(band)
        return sum(part.seconds for part, _ in kept) + self._join([path for _, path in sorted(kept)])

    def _band(self, band: Part, progress: Progress | None) -> _Done:
        """A band; nothing is smaller than one row, which takes as long as it does."""
        done = self._render(band, self.band_file, progress)
        if done.is_whole or band.size > 1:
            return done
        with overridden(self.scene.cycles, {"time_limit": 0.0}):
            return dataclasses.replace(self._render(band, self.band_file, progress), is_whole=True)

    def _join(self, paths: list[Path]) -> float:
        started = time.perf_counter()
        exr.join_rows(paths, self.path, half=self.scene.render.image_settings.color_depth == "16")
        return time.perf_counter() - started

    def _render(self, band: Part, path: Path, progress: Progress | None) -> _Done:
        first = self.target.rows.first
        shown = border(Part(first + band.first, first + band.last), self.scene.render.resolution_y)
        with overridden(self.scene.render, shown), _watched() as seen:
            seconds = self.render(path, progress)
        is_whole = seen.whole or seconds < self.pace.timeout
        sampling = time.perf_counter() - seen.since if seen.since else seconds
        return _Done(dataclasses.replace(band, seconds=seconds), dataclasses.replace(band, seconds=sampling), is_whole)


@dataclasses.dataclass(frozen=True)
class _Done:
    """A band that was rendered."""

    part: Part
    sampling: Part  # with the seconds of its samples alone
    is_whole: bool  # with all its samples


def border(band: Part, rows: int) -> dict[str, object]:
    """Render settings that show just this band of an image of so many rows; Blender counts them from below."""
    # Blender cuts to whole pixels: from the middle of one no rounding leads to its neighbour.
    low = 0.0 if band.last == rows else (rows - band.last + 0.5) / rows
    high = 1.0 if band.first == 0 else (rows - band.first + 0.5) / rows
    return {"use_border": True, "use_crop_to_border": True, "border_min_x": 0.0, "border_max_x": 1.0,
            "border_min_y": low, "border_max_y": high}


@dataclasses.dataclass
class _Seen:
    """What Cycles has said of a render."""

    since: float = 0.0  # when its first samples began, 0 if it did not say
    whole: bool = False  # that the last sample is done


@contextmanager
def _watched() -> Iterator[_Seen]:
    seen = _Seen()

    def look(statistics: str, *_: object) -> None:
        fraction = sample_fraction(statistics)
        if fraction is not None:
            seen.since = seen.since or time.perf_counter()
            seen.whole = seen.whole or fraction >= 1

    bpy.app.handlers.render_stats.append(look)
    try:
        yield seen
    finally:
        bpy.app.handlers.render_stats.remove(look)
