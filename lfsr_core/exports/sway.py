"""Short films of an eye that moves in front of the display: sway, round an ellipse, and wiggle, between two eyes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from lfsr_core.base.arrays import Array
from lfsr_core.base.notices import Progress
from lfsr_core.exports.films import write_film as write_frames
from lfsr_core.exports.format_names import FILM_TYPES, WIGGLE_TYPES
from lfsr_core.exports.light_field import LightField
from lfsr_core.exports.options import ExportOptions, chosen_type
from lfsr_core.exports.screen_images import on_screen, usual_width
from lfsr_core.exports.stereo import eye_distance

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


def _between_eyes(field: LightField, options: ExportOptions, phase: float) -> tuple[float, float]:
    return (eye_distance(field, options) / 2 * math.sin(2 * math.pi * phase), 0.0)


SWAY = Motion("sway", FILM_TYPES, 4.0, 1, lambda field, _, phase: eye_place(field, phase))
WIGGLE = Motion("wiggle", WIGGLE_TYPES, 0.8, 5, _between_eyes)


def write(motion: Motion, field: LightField, folder: Path, options: ExportOptions) -> None:
    """Write the film of one frame, while the eye moves."""
    chosen = chosen_type(options, motion.types)
    rate = options.fps or RATES[chosen]
    rounds = 1 if chosen in LOOPING else motion.rounds
    count = max(2, round((options.seconds or motion.seconds) * rate)) * rounds
    phases = (number * rounds / count % 1 for number in range(count))
    _write(motion, ((field, phase) for phase in phases), count, rate, folder, options)


def write_film(motion: Motion, fields: Iterator[LightField], count: int, folder: Path,
               options: ExportOptions) -> None:
    """Write the film of ``count`` frames, while the eye moves one or more whole rounds."""
    rate = options.fps or ANIMATION_RATE
    rounds = max(1, round(count / rate / (options.seconds or motion.seconds)))
    places = ((field, rounds * number / count % 1) for number, field in enumerate(fields))
    _write(motion, places, count, rate, folder, options)


def _write(motion: Motion, places: Iterable[tuple[LightField, float]], count: int, rate: float, folder: Path,
           options: ExportOptions) -> None:
    """Write ``count`` frames, each the view of a light field from a phase of the eye's round."""
    chosen = chosen_type(options, motion.types)
    places = iter(places)
    first = next(places)
    frames = _frames(motion, itertools.chain([first], places), count, options)
    write_frames(folder / f"{first[0].name}_{motion.name}.{chosen}", frames, rate)


def _frames(motion: Motion, places: Iterable[tuple[LightField, float]], count: int,
            options: ExportOptions) -> Iterator[Array]:
    for number, (field, phase) in enumerate(places):
        options.tell(Progress("export", number / count, f"frame {number + 1} of {count}"))
        view = field.seen_from(*motion.place(field, options, phase))
        yield on_screen(view, field.display, options.width or usual_width(field.display))
