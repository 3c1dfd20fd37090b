"""Mute keyframes, drivers and camera markers that would change the settings of a render."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager

import bpy

from ..scene.overrides import overridden


@contextmanager
def resting(scene: bpy.types.Scene) -> Iterator[None]:
    """Mute what animates the settings of a render inside the block; ``scene`` must be at the frame to render.

    Blender evaluates animation again when a render starts. This mutes all keyframes and drivers of the scene
    itself, which keeps its values of this frame, and those of the pass index of objects.
    """
    indices = (curve for item in bpy.data.objects for curve in _curves(item) if curve.data_path == "pass_index")
    with ExitStack() as stack:
        for marker in scene.timeline_markers:
            stack.enter_context(overridden(marker, {"camera": None}))
        for curve in [*_curves(scene), *indices]:
            stack.enter_context(overridden(curve, {"mute": True}))
        yield


def _curves(owner: bpy.types.ID) -> Iterator[bpy.types.FCurve]:
    """Curves of drivers, of the action, and of the strips of the nonlinear animation of ``owner``."""
    animation = owner.animation_data
    if animation is None:
        return
    yield from animation.drivers
    strips = [strip for track in animation.nla_tracks for strip in track.strips]
    for holder in (animation, *strips):
        if holder.action is not None:
            yield from _curves_of(holder.action, holder.action_slot)


def _curves_of(action: bpy.types.Action, slot: bpy.types.ActionSlot | None) -> Iterable[bpy.types.FCurve]:
    strips = [strip for layer in action.layers for strip in layer.strips]
    bags = [strip.channelbag(slot) for strip in strips] if slot is not None else []
    return [curve for bag in bags if bag is not None for curve in bag.fcurves]
