"""Rendered frames of an animation that neighbour a frame, for temporal averaging."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path

from lfsr_core.base.notices import Notice
from lfsr_core.frames.frame import FRAME_FILE, LOW_RES_FILE, Frame, read_frame
from lfsr_core.frames.identity import first_difference
from lfsr_core.frames.low_res import LowResEIA, low_resolution
from lfsr_core.images.exr import read_finite

NUMBERED = re.compile(r"-?\d{3,}$")  # names made by ``frame_folder``
# Fields that two frames must have in common for their pixels to be samples of the same rays.
COMMON = ("display", "scale", "array", "matrix_world", "samples", "convention", "view_aperture", "lens_list", "clip",
          "world_visible", "world_apart")


@dataclasses.dataclass(frozen=True)
class Neighbour:
    """A frame near another one."""

    folder: Path
    number: int
    same_rays: bool  # False where the camera array has moved, or render settings differ
    same_seed: bool  # True where both have the same noise, which a mean over both would keep

    @property
    def usable(self) -> bool:
        """Whether averaging with it removes noise."""
        return self.same_rays and not self.same_seed


def neighbours_of(folder: Path, frame: Frame, count: int) -> list[Neighbour]:
    """Rendered frames ``near`` the one in ``folder``, from the folders beside it."""
    wanted = {name: vars(frame)[name] for name in COMMON}
    others = {beside: read_frame(beside) for beside in numbered_beside(folder, count)}
    return [Neighbour(beside, int(beside.name), not first_difference(vars(other), wanted), other.seed == frame.seed)
            for beside, other in others.items()]


def numbered_beside(folder: Path, count: int, planned: Iterable[int] = ()) -> list[Path]:
    """Folders of frames ``near`` the one in ``folder``, of those rendered or ``planned``."""
    if not NUMBERED.match(folder.name):
        return []
    numbers = numbered(folder.parent) | {number: folder.parent / f"{number:04d}" for number in planned}
    return [numbers[number] for number in near(int(folder.name), numbers, count)]


def numbered(output: Path) -> dict[int, Path]:
    """Folders of the rendered frames of an animation in ``output``, by their numbers."""
    found = output.iterdir() if output.is_dir() else ()
    return {int(path.name): path for path in found if NUMBERED.match(path.name)
            and (path / FRAME_FILE).is_file() and (path / LOW_RES_FILE).is_file()}


def near(number: int, numbers: Collection[int], count: int) -> list[int]:
    """The ``count`` of ``numbers`` below ``number`` and above it; at the ends more from the other side."""
    every = sorted({*numbers, number})
    first = max(0, min(every.index(number) - count, len(every) - 2 * count - 1))
    return [other for other in every[first:first + 2 * count + 1] if other != number]


def read_low(folder: Path) -> LowResEIA:
    """Low-resolution EIA of a frame folder, without its world; LfsrError where it cannot be read."""
    return low_resolution(read_finite(folder / LOW_RES_FILE)[0], read_frame(folder))


def averaging_notices(neighbours: Sequence[Neighbour]) -> list[Notice]:
    """Notices of neighbours that were not averaged: those with the same noise, and those that show other rays."""
    same_seed = [each.number for each in neighbours if each.same_seed]
    other_rays = [each.number for each in neighbours if not each.same_rays]
    return [*([Notice("averaging-same-seed", {"frames": same_seed})] if same_seed else []),
            *([Notice("averaging-other-rays", {"frames": other_rays})] if other_rays else [])]
