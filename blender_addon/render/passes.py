"""Enable the Cycles passes for the layers of a frame folder."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

import bpy

from ..scene.overrides import overridden

FOREGROUND, BACKGROUND = 1, 2


@contextmanager
def enabled(scene: bpy.types.Scene, layers: Sequence[str], environment: bool) -> Iterator[None]:
    """Enable only the passes of ``layers``, on the first view layer that is used for rendering, inside the block."""
    view_layers = [layer for layer in scene.view_layers if layer.use] or [scene.view_layers[0]]
    wanted = {"use_pass_combined", *(["use_pass_position"] if "position" in layers else []),
              *(["use_pass_object_index"] if "index" in layers else []),
              *(["use_pass_environment"] if environment else [])}
    chosen = view_layers[0]
    switches = {name: name in wanted for name in _names(chosen) if name.startswith("use_pass_")}
    with ExitStack() as stack:
        for layer in view_layers[1:]:
            stack.enter_context(overridden(layer, {"use": False}))
        stack.enter_context(overridden(chosen, switches | {"use": True, "material_override": None}))
        stack.enter_context(overridden(chosen.cycles, _cycles_switches(chosen, layers)))
        yield


def _names(owner: bpy.types.bpy_struct) -> list[str]:
    return [item.identifier for item in owner.bl_rna.properties]


def _cycles_switches(view_layer: bpy.types.ViewLayer, layers: Sequence[str]) -> dict[str, bool]:
    """Switches of Cycles' own passes; its denoising albedo and normal see through glass."""
    own = [name for name in _names(view_layer.cycles) if name.startswith(("use_pass_", "pass_"))]
    features = "albedo" in layers or "normal" in layers
    return dict.fromkeys(own, False) | {"use_denoising": False, "denoising_store_passes": features}


@contextmanager
def pass_indices(foreground: set[bpy.types.Object]) -> Iterator[None]:
    """Set the pass index FOREGROUND on ``foreground`` and BACKGROUND on all other objects inside the block."""
    with ExitStack() as stack:
        for item in bpy.data.objects:  # linked ones too: the change is not saved
            index = FOREGROUND if item in foreground else BACKGROUND
            stack.enter_context(overridden(item, {"pass_index": index}))
        yield
