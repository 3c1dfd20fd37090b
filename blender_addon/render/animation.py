"""Our settings hold whatever the scene animates: keyframes, drivers and camera markers rest while one frame renders.

Blender evaluates animation again when a render starts, and its values would replace those that were set for it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager

import bpy

from .overrides import overridden

PASS_INDEX = "pass_index"


@contextmanager
def resting(scene: bpy.types.Scene) -> Iterator[None]:
    """Inside the block nothing animates what a render sets; begin it when ``scene`` is at the frame to render.

    Of the scene itself every keyframe and driver rests: its values stay those of this frame. Of objects
    only what drives their pass index does.
    """
    with ExitStack() as stack:
        for marker in scene.timeline_markers:
            stack.enter_context(overridden(marker, {"camera": None}))
        stack.enter_context(_muted(scene, lambda path: True))
        for item in bpy.data.objects:
            if item.animation_data and item.is_editable:
                stack.enter_context(_muted(item, lambda path: path == PASS_INDEX))
        yield


@contextmanager
def _muted(owner: bpy.types.ID, wanted: Callable[[str], bool]) -> Iterator[None]:
    """Curves and drivers of ``owner`` whose data path is ``wanted`` are muted inside the block."""
    animation = owner.animation_data
    with ExitStack() as stack:
        for curve in _curves(animation) if animation else ():
            if wanted(curve.data_path):
                stack.enter_context(overridden(curve, {"mute": True}))
        yield


def _curves(animation: bpy.types.AnimData) -> Iterator[bpy.types.FCurve]:
    """Every curve that moves its owner: drivers, the action's, those of strips of the non-linear animation."""
    yield from animation.drivers
    strips = [strip for track in animation.nla_tracks for strip in track.strips]
    for holder in (animation, *strips):
        if holder.action is not None:
            yield from _curves_of(holder.action, holder.action_slot)


def _curves_of(action: bpy.types.Action, slot: bpy.types.ActionSlot | None) -> Iterable[bpy.types.FCurve]:
    strips = [strip for layer in action.layers for strip in layer.strips]
    bags = [strip.channelbag(slot) for strip in strips] if slot is not None else []
    return [curve for bag in bags if bag is not None for curve in bag.fcurves]
