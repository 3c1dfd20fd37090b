"""The scale that a scene's depth calls for."""

from __future__ import annotations

from contextlib import suppress

import bpy
import numpy as np

from lfsr_core.base.arrays import Array
from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.request import Request
from lfsr_core.optics.depth_scale import ScaleChoice, choose_scale, disparities
from lfsr_core.optics.display import DisplayProfile

from ..subject import find_subject
from . import motion, placement

CHOOSE, LOOK = "scale", "depth"  # the headless Blender's words for these jobs


def scale_of(scene: bpy.types.Scene, job: Request) -> ScaleChoice:
    """Choose one of the job's scales by the depth at which the middle of the array sees the subject in its frames."""
    return choose_scale(job.display, all_moves(scene, job), job.sampling.scales, job.judged_rays)


def all_moves(scene: bpy.types.Scene, job: Request) -> Array:
    """Disparities (n,), in lenses, of what the middle of the array sees of the subject in the job's frames."""
    subject, moves = find_subject(scene, job.subject), [np.empty(0)]
    for _ in motion.visited(scene, job.sampling.frames):
        with suppress(LfsrError):  # no array where the subject is out of sight: its frame says so when it is rendered
            moves.append(moves_of(scene, job.display, subject))
    return np.concatenate(moves)


def moves_of(scene: bpy.types.Scene, display: DisplayProfile, subject: set[bpy.types.Object]) -> Array:
    """Disparities (n,), in lenses, of what the middle of the array sees of the ``subject`` in the current frame."""
    placed = placement.place_array(scene, display, subject)
    return disparities(display, placed[0], placement.seen_depths(scene, placed, subject))
