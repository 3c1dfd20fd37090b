"""Build the demo scene and save it: run inside Blender's Python with the .blend to write as last argument.

Everything is made here from Blender's own shapes and one of its own HDRIs. One
unit is 10 cm of the 32-inch display at true size: the camera looks along +Y from
1 m, the display plane is y = 0, things reach from 13 cm before it to 16 cm behind.
Left and right, top and bottom, near and far all differ, so that a mirrored
picture shows.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import bpy

CAMERA_DISTANCE = 10.0
DISPLAY_WIDTH = 7.084


def main(path: Path) -> None:
    """Write the scene to ``path``."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    things()
    light()
    camera()
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.film_transparent = True
    scene.view_settings.view_transform = "AgX"
    scene.view_settings.look = "AgX - Punchy"
    bpy.ops.wm.save_as_mainfile(filepath=str(path.resolve()), compress=True)


def things() -> None:
    """Diffuse, plastic, metal and glass, before, on and behind the display plane."""
    mesh = bpy.ops.mesh
    mesh.primitive_cylinder_add(vertices=96, radius=3.0, depth=0.2, location=(0, 0.2, -1.75))
    paint(material("Slab", (0.35, 0.22, 0.12), roughness=0.6), scale=(1.0, 0.5, 1.0))
    mesh.primitive_monkey_add(size=2.2, location=(-0.3, 0.25, -0.6), rotation=(-0.25, 0, 0.35))
    bpy.ops.object.modifier_add(type="SUBSURF")
    bpy.context.object.modifiers[0].render_levels = 2
    paint(material("Clay", (0.80, 0.27, 0.09), roughness=0.75))
    mesh.primitive_uv_sphere_add(segments=96, ring_count=48, radius=0.5, location=(1.3, -0.75, -1.15))
    paint(material("Glass", (0.75, 0.95, 0.85), roughness=0.0, glass=True))
    mesh.primitive_torus_add(major_radius=0.75, minor_radius=0.22, major_segments=128, minor_segments=48,
                             location=(1.95, 1.1, -0.6), rotation=(1.35, 0.0, 0.5))
    paint(material("Gold", (1.0, 0.62, 0.18), roughness=0.18, metallic=1.0))
    mesh.primitive_cone_add(vertices=96, radius1=0.55, depth=1.5, location=(-2.2, 0.9, -0.9))
    paint(material("Blue plastic", (0.03, 0.12, 0.65), roughness=0.25))
    mesh.primitive_cube_add(size=0.6, location=(-1.45, -0.9, -1.35), rotation=(0, 0, 0.6))
    paint(material("Green", (0.08, 0.45, 0.10), roughness=0.5))
    bpy.ops.object.text_add(location=(0.1, 0.0, 0.85), rotation=(math.pi / 2, 0, 0))
    bpy.context.object.data.body, bpy.context.object.data.size = "LFSR", 0.9
    bpy.context.object.data.extrude = 0.06
    paint(material("Silver", (0.9, 0.9, 0.92), roughness=0.35, metallic=1.0))


def paint(surface: bpy.types.Material, scale: tuple[float, float, float] = (1, 1, 1)) -> None:
    """Give the object just added its material, size and smooth shading."""
    item = bpy.context.object
    item.name, item.scale = surface.name, scale
    item.data.materials.append(surface)
    if item.type == "MESH" and surface.name not in ("Green", "Slab"):
        for polygon in item.data.polygons:
            polygon.use_smooth = True


def material(name: str, color: tuple[float, float, float], roughness: float, metallic: float = 0.0,
             glass: bool = False) -> bpy.types.Material:
    """One Principled surface; ``color`` is scene-linear."""
    surface = bpy.data.materials.new(name)
    surface.use_nodes = True
    node = next(node for node in surface.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    values = {"Base Color": (*color, 1.0), "Roughness": roughness, "Metallic": metallic,
              "Transmission Weight": float(glass), "IOR": 1.45}
    for socket, value in values.items():
        node.inputs[socket].default_value = value
    return surface


def light() -> None:
    """One of the HDRIs that ship inside Blender, and a warm lamp from the upper left."""
    world = bpy.data.worlds.new("World")
    bpy.context.scene.world = world
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    background = next(node for node in nodes if node.type == "BACKGROUND")
    texture = nodes.new("ShaderNodeTexEnvironment")
    folder = Path(bpy.utils.system_resource("DATAFILES"), "studiolights", "world")
    texture.image = bpy.data.images.load(str(folder / "interior.exr"))
    texture.image.pack()
    links.new(texture.outputs["Color"], background.inputs["Color"])
    bpy.ops.object.light_add(type="AREA", location=(-4, -5, 5), rotation=(0.85, 0, -0.65))
    lamp = bpy.context.object.data
    lamp.energy, lamp.size, lamp.color = 600, 2.5, (1.0, 0.9, 0.75)


def camera() -> None:
    """At the viewing position of the 32-inch display, focused on the display plane."""
    bpy.ops.object.camera_add(location=(0, -CAMERA_DISTANCE, 0), rotation=(math.pi / 2, 0, 0))
    item = bpy.context.object
    item.data.sensor_fit = "HORIZONTAL"
    item.data.angle = 2 * math.atan(DISPLAY_WIDTH / 2 / CAMERA_DISTANCE)
    item.data.dof.use_dof, item.data.dof.focus_distance = True, CAMERA_DISTANCE
    bpy.context.scene.camera = item


if __name__ == "__main__":
    main(Path(sys.argv[-1]))
