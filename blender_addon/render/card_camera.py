"""A camera that sends the rays of a ray layout on every device, through a lens card or a panel card."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import mathutils

from lfsr_core.optics.lens_card import lens_card
from lfsr_core.optics.panel.panel_card import panel_card
from lfsr_core.optics.panel.panel_rays import PanelLayout
from lfsr_core.optics.rays import RayLayout

from ..scene.array.spaces import Matrix, to_blender
from ..scene.overrides import new_data, overridden
from ..scene.volumes import distance_to_volume
from .card_parts import Place, new_camera, place_of
from .lens_card import new_card
from .panel_card import new_panel_card

Layout = RayLayout | PanelLayout


@contextmanager
def card_camera(scene: bpy.types.Scene, layout: Layout, matrix_world: Matrix,
                clip_start: float = 0.0) -> Iterator[bpy.types.Object]:
    """Make a camera with the card of ``layout`` the scene's camera inside the block; rays start at ``clip_start``."""
    frame = to_blender(matrix_world)
    place = place_of(layout.array, frame.translation.length, clip_start)
    with new_data() as made:
        # Cycles asks at the card which volumes a path begins in.
        camera, screen = _new_pair(made, layout, distance_to_volume(scene, frame.translation), place)
        for item, behind in ((camera, place.gap), (screen, place.gap / 2)):
            item.matrix_world = frame @ mathutils.Matrix.Translation((0, 0, behind))
            scene.collection.objects.link(item)
        # The card is one more surface that a path passes through.
        with (overridden(scene, {"camera": camera}), overridden(
                scene.cycles, {"transparent_max_bounces": scene.cycles.transparent_max_bounces + 1})):
            yield camera


def _new_pair(made: list[bpy.types.ID], layout: Layout, radius: float,
              place: Place) -> tuple[bpy.types.Object, bpy.types.Object]:
    width, distance = layout.size[0], layout.array.distance
    if isinstance(layout, PanelLayout):
        panel = panel_card(layout, radius)
        return (new_camera(made, width * panel.pixel, panel.spreads, place),
                new_panel_card(made, panel, distance, place))
    card = lens_card(layout, radius)
    return new_camera(made, width * card.pixel, card.spreads, place), new_card(made, card, distance, place)
