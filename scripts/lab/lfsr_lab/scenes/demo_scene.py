"""Build the demo scene and save it: run inside Blender's Python with the .blend to write as last argument.

Everything is made here from Blender's own shapes and one of its own HDRIs, around the display of ``demo_camera``:
things reach from 13 cm before its plane to 16 cm behind. Left and right, top and bottom, near and far all differ, so
that a mirrored image shows.
"""

import math
import sys
from pathlib import Path

# Where lfsr_lab and lfsr_core are: installed side by side, or in a clone, scripts/lab and the root.
sys.path.extend(str(Path(__file__).resolve().parents[level]) for level in (2, 4))

import bpy

from lfsr_lab.scenes.shared.objects import demo_camera, lamp, paint, save, script_paths, world


def main(path: Path) -> None:
    demo_camera()
    things()
    world("interior", 1.0)
    lamp((-4, -5, 5), 600, 2.5, (1.0, 0.9, 0.75)).rotation_euler = (0.85, 0, -0.65)
    view = bpy.context.scene.view_settings
    view.view_transform, view.look = "AgX", "AgX - Punchy"
    save(path)


def things() -> None:
    """Diffuse, plastic, metal and glass, before, on and behind the display plane."""
    mesh = bpy.ops.mesh
    mesh.primitive_cylinder_add(vertices=96, radius=3.0, depth=0.2, location=(0, 0.2, -1.75))
    finish("Slab", (0.35, 0.22, 0.12), 0.6, smooth=False)
    bpy.context.object.scale = (1.0, 0.5, 1.0)
    mesh.primitive_monkey_add(size=2.2, location=(-0.3, 0.25, -0.6), rotation=(-0.25, 0, 0.35))
    bpy.ops.object.modifier_add(type="SUBSURF")
    bpy.context.object.modifiers[0].render_levels = 2
    finish("Clay", (0.80, 0.27, 0.09), 0.75)
    mesh.primitive_uv_sphere_add(segments=96, ring_count=48, radius=0.5, location=(1.3, -0.75, -1.15))
    finish("Glass", (0.75, 0.95, 0.85), 0.0, Transmission_Weight=1.0)
    mesh.primitive_torus_add(major_radius=0.75, minor_radius=0.22, major_segments=128, minor_segments=48,
                             location=(1.95, 1.1, -0.6), rotation=(1.35, 0.0, 0.5))
    finish("Gold", (1.0, 0.62, 0.18), 0.18, Metallic=1.0)
    mesh.primitive_cone_add(vertices=96, radius1=0.55, depth=1.5, location=(-2.2, 0.9, -0.9))
    finish("Blue plastic", (0.03, 0.12, 0.65), 0.25)
    mesh.primitive_cube_add(size=0.6, location=(-1.45, -0.9, -1.35), rotation=(0, 0, 0.6))
    finish("Green", (0.08, 0.45, 0.10), 0.5, smooth=False)
    bpy.ops.object.text_add(location=(0.1, 0.0, 0.85), rotation=(math.pi / 2, 0, 0))
    text = bpy.context.object.data
    text.body, text.size, text.extrude = "LFSR", 0.9, 0.06
    finish("Silver", (0.9, 0.9, 0.92), 0.35, smooth=False, Metallic=1.0)


def finish(name: str, color: tuple[float, float, float], roughness: float, smooth: bool = True,
           **inputs: float) -> None:
    """Give the object just added its name, material and shading."""
    item = bpy.context.object
    item.name = name
    item.data.materials.append(paint(name, color, roughness, IOR=1.45, **inputs))
    if smooth:
        item.data.polygons.foreach_set("use_smooth", [True] * len(item.data.polygons))


if __name__ == "__main__":
    main(**script_paths(__doc__, path="SCENE.blend"))
