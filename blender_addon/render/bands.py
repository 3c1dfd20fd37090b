"""Long renders in bands of pixel rows, whatever the camera: what is whole is kept, and a next run goes on from it.

A band is the image's own border render. Cycles draws its random numbers by a pixel's place in the full frame, so that
bands below each other are the image to the byte (measured in 5.0, every layer, bands of one row too).
"""

from __future__ import annotations

import dataclasses
import functools
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

from lfsr_core.images import exr
from lfsr_core.render.pace import Pace
from lfsr_core.render.parts import ImageParts, Part, gaps

from .overrides import overridden
from .progress import Progress, sample_fraction, share

WIDEST_TILE = 8192  # Cycles times tiles, not images: a band has to be one tile
# Renders the scene as it is set up into a file; seconds.
Render = Callable[[bpy.types.Scene, Path, Progress | None], float]


def render_in_bands(render: Render, scene: bpy.types.Scene, path: Path, progress: Progress | None,
                    parts: ImageParts) -> float:
    """Render the image that ``scene`` is set up for, in bands if it takes long.

    Parameters
    ----------
    render : renders the image, or the part of it inside the border that is set, into a file
    scene : set up for the image
    path : EXR to write
    progress : of the whole image
    parts : keeps bands that are whole, and has those of an earlier run

    Returns
    -------
    Seconds it took, those of kept bands too.
    """
    pace = Pace(scene.render.resolution_x, scene.render.resolution_y, scene.cycles.samples)
    with overridden(scene.cycles, _timed(pace)):
        kept = parts.kept(pace.rows)
        image = _Image(functools.partial(render, scene), scene, path, progress, pace, parts)
        if not kept and pace.is_short and (done := image.at_once()):
            return done.seconds
        trial = image.trial()
        if not kept and pace.takes_one(trial) and (done := image.at_once()):
            return done.seconds
        return image.in_bands(kept, pace.after(trial))


def _timed(pace: Pace) -> dict[str, object]:
    """The same for the trial and for every band: another value would make Cycles build the scene again."""
    limit = pace.timeout if pace.width <= WIDEST_TILE else 0.0
    return {"time_limit": limit, "use_auto_tile": True, "tile_size": WIDEST_TILE}


@dataclasses.dataclass(frozen=True)
class _Image:
    """One image that may take long."""

    render: Callable[[Path, Progress | None], float]
    scene: bpy.types.Scene
    path: Path
    progress: Progress | None
    pace: Pace
    parts: ImageParts

    def trial(self) -> Part:
        """The trial rows with the seconds of their samples; their pixels are thrown away."""
        return self._render(self.pace.trial, self.path, None).sampling

    def at_once(self) -> Part | None:
        """The whole image; None where it takes too long."""
        done = self._render(Part(0, self.pace.rows), self.path, self.progress)
        return done.part if done.is_whole else None

    def in_bands(self, kept: list[tuple[Part, Path]], rows: int) -> float:
        """What is missing, band by band, the first of ``rows`` rows; then all of them as one image. Seconds."""
        kept = list(kept)
        while missing := gaps(self.pace.rows, (part for part, _ in kept)):
            band = Part(missing[0].first, min(missing[0].last, missing[0].first + rows))
            working = self.parts.working_file()
            before = sum(part.size for part, _ in kept)
            watch = share(self.progress, before, band.size, self.pace.rows)
            done = self._render(band, working, watch)
            if not done.is_whole and band.size == 1:
                with overridden(self.scene.cycles, {"time_limit": 0.0}):
                    done = dataclasses.replace(self._render(band, working, watch), is_whole=True)
            if done.is_whole:
                kept.append((done.part, self.parts.keep(working, done.part)))
                rows = self.pace.after(done.sampling)
            else:
                rows = self.pace.after_timeout(band)
        started = time.perf_counter()
        exr.join_rows([path for _, path in sorted(kept)], self.path,
                      half=self.scene.render.image_settings.color_depth == "16")
        return sum(part.seconds for part, _ in kept) + time.perf_counter() - started

    def _render(self, band: Part, path: Path, progress: Progress | None) -> _Done:
        with overridden(self.scene.render, border(band, self.pace.rows)), _watched() as seen:
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
