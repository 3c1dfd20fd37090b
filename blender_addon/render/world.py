"""Render a visible world separately from the subject.

The world depends on a ray's direction only, so one small image holds what every ray at full resolution sees of it
(``lfsr_core.optics.world_view``). In the low-resolution render camera rays see a white world, so that the layer
``environment`` holds the fraction of the world that shows.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

from lfsr_core.optics.world_view import WorldImage

from .. import compat
from ..compat import new_data, overridden
from ..scene.array.rig import Matrix
from ..scene.contents import has_coordinates, nodes_of, rendered
from .cards import Wiring
from .cycles import RenderSettings, cycles_settings, pixel_aspect, temporary_camera
from .output import render_to

NAME = "LFSR World"
# Per pixel of the image; a pixel of the light field sees 36. More change it by 4e-4 (rms of sRGB values).
SAMPLES = 4
SENSOR_MM = 36.0
CLIP = 0.1, 1000.0  # scene units; only rounding depends on it
LEAST_EXPOSURE = 1e-6


def reason_against(scene: bpy.types.Scene) -> str:
    """Return what keeps the scene's visible world from being rendered separately, "" if nothing does."""
    outputs = [node for node in nodes_of(scene.world.node_tree) if node.bl_idname == "ShaderNodeOutputWorld"]
    if any(node.inputs["Volume"].is_linked for node in outputs):
        return "volume"
    if has_coordinates(scene.world.node_tree, ("Window", "Camera")):
        return "coordinates"
    if any(item.type == "LIGHT" and item.data.type == "SUN" and item.visible_camera for item in rendered(scene)):
        return "sun"
    return ""


@contextmanager
def white_to_camera(scene: bpy.types.Scene, kept: list[bpy.types.ID] | None = None) -> Iterator[None]:
    """Show camera rays a world of radiance 1 inside the block; all other rays see the scene's own.

    It is 1 in the image, to which Cycles applies the film's exposure. ``kept``: the caller's new data, in which this
    world stays for the next render of the same frame.
    """
    if same_frame := [item for item in kept or () if item.get(NAME) == scene.frame_current]:
        with overridden(scene, {"world": same_frame[0]}):
            yield
        return
    with new_data() as made:
        made += kept or ()  # removed after the block, because they are of another frame
        shown = bpy.data.worlds.new(NAME) if scene.world.is_missing else scene.world.copy()  # 5.0 gives that no nodes
        shown[NAME] = scene.frame_current
        kept = made if kept is None else kept
        kept[:] = [shown]
        plain = shown.node_tree is None
        compat.use_nodes(shown)
        wiring = Wiring(shown.node_tree)
        output = shown.node_tree.get_output_node("CYCLES") or wiring.node("ShaderNodeOutputWorld")
        seen, mix = wiring.node("ShaderNodeLightPath"), wiring.node("ShaderNodeMixShader")
        white = wiring.node("ShaderNodeBackground", Color=(1, 1, 1, 1),
                            Strength=1 / max(scene.cycles.film_exposure, LEAST_EXPOSURE))
        links = output.inputs["Surface"].links
        if plain:
            wiring.link(wiring.node("ShaderNodeBackground", Color=(*shown.color, 1)).outputs[0], mix.inputs[1])
        elif links:
            wiring.link(links[0].from_socket, mix.inputs[1])
        wiring.link(seen.outputs["Is Camera Ray"], mix.inputs[0])
        wiring.link(white.outputs[0], mix.inputs[2])
        wiring.link(mix.outputs[0], output.inputs["Surface"])
        with overridden(scene, {"world": shown}):
            yield


def render_world(scene: bpy.types.Scene, image: WorldImage, matrix_world: Matrix, settings: RenderSettings,
                 path: Path) -> float:
    """Render only the world of ``scene``, seen from the array, into ``path``; return the seconds."""
    with new_data() as made:
        alone = bpy.data.scenes.new(NAME)
        made.append(alone)
        alone.world = scene.world
        alone.cycles.film_exposure = scene.cycles.film_exposure
        alone.frame_current, alone.frame_subframe = scene.frame_current, scene.frame_subframe
        # Nothing is lit, so Cycles needs no importance map of the world.
        unlit = {"sampling_method": "NONE"} if scene.world.is_editable else {}
        seen = {"film_transparent": False, "use_persistent_data": False} | pixel_aspect(image.step[1] / image.step[0])
        with (overridden(scene.world.cycles, unlit), temporary_camera(alone, matrix_world, 1.0) as camera,
              cycles_settings(alone, settings, image.size), overridden(alone.render, seen)):
            camera.name, lens = NAME, camera.data  # files name the camera
            lens.type, lens.sensor_fit, lens.sensor_width = "PERSP", "HORIZONTAL", SENSOR_MM
            lens.lens = SENSOR_MM / 2 / image.reach[0]
            lens.clip_start, lens.clip_end = CLIP
            return render_to(alone, path)
