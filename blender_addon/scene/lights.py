"""Lights as the panel lists them."""

from __future__ import annotations

import zlib

import bpy

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.request import AUTO, EVEN, OWN, WORLD_IMAGES, check_light

AUTO_LIGHT, OWN_LIGHT, FILE_LIGHT = "AUTO", "OWN", "FILE"
SCENE_LIGHTS = (AUTO_LIGHT, OWN_LIGHT)  # in which the scene's own light counts
# Menu entry, in Blender's capitals: name in a job.
NAMES = {AUTO_LIGHT: AUTO, OWN_LIGHT: OWN, EVEN.upper(): EVEN, **{name.upper(): name for name in WORLD_IMAGES}}


def light_of(scene: bpy.types.Scene) -> str:
    """Return the light of a scene's settings as a job has it; nothing is checked."""
    if scene.lfsr.light == FILE_LIGHT:
        return bpy.path.abspath(scene.lfsr.light_file)
    return NAMES[scene.lfsr.light]


def check_chosen(light: str) -> None:
    """LfsrError if ``light``, as of ``light_of``, cannot light a scene."""
    if not light:
        raise LfsrError("no light file is chosen: give a .hdr or .exr file, or choose another light")
    check_light(light)


def light_items() -> list[tuple[str, str, str, int]]:
    """Enum items; each has a number of its own, so that new lights do not change saved scenes."""
    texts = {AUTO_LIGHT: ("Auto", "The scene's own light. A scene without light is lit with one of Blender's world "
                          "images"),
             OWN_LIGHT: ("Scene", "The scene's own light, even if it has none"),
             EVEN.upper(): ("Even", "Light from all sides without shadows, also inside a closed room")}
    texts |= {name.upper(): (name.title(), f"Blender's world image {name!r}; lamps of the scene stay")
              for name in WORLD_IMAGES}
    texts[FILE_LIGHT] = "From File…", "A world image of yours (.hdr or .exr); lamps of the scene stay"
    return [(name, *text, zlib.crc32(name.encode()) & 0x7FFFFFFF) for name, text in texts.items()]
