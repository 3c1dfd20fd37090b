"""Sample frames of a scene's animation."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from lfsr_core.frames.request import spread

MOST_FRAMES = 24  # sampled from an animation


def frames(scene: bpy.types.Scene) -> Iterator[int]:
    """Set the scene to sample frames of its animation in turn, yield their numbers, and restore its current frame.

    A scene without animation yields its current frame only.
    """
    first, last = frame_range(scene)
    return visited(scene, spread(range(first, last + 1), MOST_FRAMES))


def visited(scene: bpy.types.Scene, numbers: Collection[int]) -> Iterator[int]:
    """As ``frames``, but of these ``numbers``; the current frame only where there are none."""
    if not numbers or not is_animated():
        yield scene.frame_current
        return
    with same_frame(scene):
        for number in numbers:
            scene.frame_set(number)
            yield number


@contextmanager
def same_frame(scene: bpy.types.Scene) -> Iterator[None]:
    """Restore the current frame of ``scene`` after the block, if it changed."""
    before = scene.frame_current, scene.frame_subframe
    try:
        yield
    finally:
        if (scene.frame_current, scene.frame_subframe) != before:
            scene.frame_set(before[0], subframe=before[1])


def is_animated() -> bool:
    """Return True if keyframes, drivers or caches may move something."""
    driven = any(item.animation_data and item.animation_data.drivers for item in bpy.data.objects)
    return driven or any(action.users for action in bpy.data.actions) or bool(bpy.data.cache_files)


def frame_range(scene: bpy.types.Scene) -> tuple[int, int]:
    """Return the first and last frame of the scene, cut to its keyframes (imported files often have few)."""
    ranges = [tuple(action.frame_range) for action in bpy.data.actions if action.users]
    if not ranges or bpy.data.cache_files:
        return scene.frame_start, scene.frame_end
    first, last = int(min(low for low, _ in ranges)), int(np.ceil(max(high for _, high in ranges)))
    first, last = max(first, scene.frame_start), min(last, scene.frame_end)
    return (first, last) if first <= last else (scene.frame_start, scene.frame_end)

