"""Pictures of docs/guide/artist-guide.md and of a lenticular display live, taken in a real window (see desktop.py):

    python tests/support/window/pictures.py docs/images
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))

from lfsr_core.optics.display import write_profile
from tests.support.panels import lenticular
from tests.support.window.desktop import VARIABLE, Window, blender_window, inside

SECONDS_TO_RENDER = 1200
SECONDS_OF_LIVE = 90   # on a busy machine
HEIGHT_OF_CHECK = 560  # the panel ends there
COLORS = 200   # keeps a picture below 300 kB
SCENE = """
scene = bpy.context.scene
for item in list(scene.objects):
    bpy.data.objects.remove(item)
def painted(color, roughness=0.4, metallic=0.0):
    material = bpy.data.materials.new("Paint")
    material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*color, 1)
    shader.inputs["Roughness"].default_value, shader.inputs["Metallic"].default_value = roughness, metallic
    material.diffuse_color = (*color, 1)
    bpy.context.object.data.materials.append(material)
bpy.ops.mesh.primitive_monkey_add(location=(0, 0, 1)); bpy.ops.object.shade_smooth(); painted((0.8, 0.25, 0.06))
bpy.ops.object.modifier_add(type="SUBSURF"); bpy.context.object.modifiers[0].render_levels = 2
bpy.ops.mesh.primitive_uv_sphere_add(radius=0.35, location=(-1.3, -1.0, 0.5)); bpy.ops.object.shade_smooth()
painted((0.05, 0.3, 0.8), 0.15)
bpy.ops.mesh.primitive_torus_add(location=(1.35, 1.0, 0.9), rotation=(1.2, 0.4, 0), major_radius=0.6, minor_radius=0.2)
bpy.ops.object.shade_smooth(); painted((0.9, 0.6, 0.1), 0.25, 1.0)
bpy.ops.mesh.primitive_plane_add(size=60, location=(0, 0, -0.02)); bpy.context.object.name = "Floor"
painted((0.6, 0.6, 0.62))
bpy.ops.object.light_add(type="AREA", radius=3, location=(3, -4, 5), rotation=(0.7, 0, 0.6))
bpy.context.object.data.energy = 700
bpy.ops.object.light_add(type="SUN", location=(-3, 4, 6), rotation=(-0.6, -0.3, 0))
for item in scene.objects:
    item.select_set(item.type == "MESH" and item.name != "Floor")
scene.render.engine, scene.render.use_motion_blur = "CYCLES", True
scene.lfsr.method = "pool"  # this Blender has no Open Image Denoise
bpy.context.space_data.shading.color_type = "MATERIAL"
bpy.context.space_data.show_region_ui = True
bpy.ops.wm.save_as_mainfile(filepath=FILE)
"""
LOOK = """
import mathutils
view = bpy.context.space_data.region_3d
view.view_perspective = "PERSP"
view.view_location, view.view_distance = (-0.6, -1.9, 0.9), 12.5
view.view_rotation = mathutils.Euler((1.22, 0, -0.62)).to_quaternion()
"""
IMAGE_EDITOR = """
area = next(area for area in bpy.context.window.screen.areas if area.type == "PROPERTIES")
area.ui_type = "IMAGE_EDITOR"
"""


def take(window: Window, folder: Path) -> None:
    """Every picture, in the order of the guide."""
    window.run(f"FILE = {str(window.folder / 'monkey.blend')!r}" + SCENE)
    window.settle()
    x, top, width, height = window.open_tab()
    window.run("bpy.ops.lfsr.array_fit('INVOKE_DEFAULT', True)" + LOOK)
    window.run("for item in bpy.context.selected_objects: item.select_set(False)")
    keep(window, folder, "panel-array")
    window.run("bpy.ops.lfsr.look_through('INVOKE_DEFAULT', True)")
    keep(window, folder, "panel-look")
    window.run("bpy.ops.lfsr.look_through('INVOKE_DEFAULT', True)")
    window.run("bpy.ops.lfsr.check_scene('INVOKE_DEFAULT', True)")
    window.run("bpy.context.window_manager.lfsr.show_problems = True; addon.jobs.images.redraw('VIEW_3D')")
    keep(window, folder, "panel-check", (x - 20, top, width + 20, HEIGHT_OF_CHECK))
    window.run("bpy.ops.lfsr.check_fix('INVOKE_DEFAULT', True, code='background', target='Floor')")
    window.run("bpy.context.window_manager.lfsr.checked_scene = ''" + IMAGE_EDITOR)
    window.run("for asked in addon.ui.operators.render.check_questions(bpy.context.scene): asked.accept()")
    window.run("bpy.ops.lfsr.render_eia('INVOKE_DEFAULT', True)")
    window.until("addon.jobs.session.current().fraction > 0.3", SECONDS_TO_RENDER)
    keep(window, folder, "panel-rendering")
    window.until("addon.jobs.session.current() is None", SECONDS_TO_RENDER)
    keep(window, folder, "panel-rendered")


def live(window: Window, folder: Path) -> None:
    """A panel under slanted cylinders, live over Blender's own window."""
    panel = lenticular(panel_pixels=[600, 400], panel_mm=[300.0, 200.0], viewing_distance_mm=600.0)
    write_profile(window.folder / "lenticular.toml", panel)
    window.close_others()
    window.run(f"lfsr = bpy.context.scene.lfsr; lfsr.profile_file = {str(window.folder / 'lenticular.toml')!r}")
    window.run("lfsr.display, lfsr.live_rays = 'FILE', 64; bpy.data.objects['Suzanne'].select_set(True)\n"
               "bpy.ops.lfsr.array_fit('INVOKE_DEFAULT', True); bpy.ops.lfsr.live()")
    window.settle()
    window.place(window.windows()[-1], *panel.panel_pixels)
    time.sleep(SECONDS_OF_LIVE)
    keep(window, folder, "live-lenticular", (0, 0, 764, 600))


def keep(window: Window, folder: Path, name: str, crop: tuple[int, int, int, int] | None = None) -> None:
    """Take a picture and make it small enough for the repository."""
    window.xdotool("mousemove", 400, 700)
    part = ["-crop", f"{crop[2]}x{crop[3]}+{crop[0]}+{crop[1]}", "+repage"] if crop else []
    taken = window.screenshot(name)
    small = taken.with_suffix(".small.png")
    subprocess.run(inside("convert", taken, *part, "+dither", "-colors", COLORS, f"PNG8:{small}"), check=True)
    shutil.copy(small, folder / f"{name}.png")


if __name__ == "__main__":
    if VARIABLE not in os.environ:
        sys.exit(f"{VARIABLE} names no folder: scripts/window_blender.sh makes it")
    for variable in ("PYTEST_DEBUG_TEMPROOT", "TMPDIR"):  # as in tests/conftest.py
        os.environ.setdefault(variable, tempfile.gettempdir())
    with tempfile.TemporaryDirectory() as scratch, blender_window(Path(scratch)) as it:
        take(it, Path(sys.argv[1]).resolve())
        live(it, Path(sys.argv[1]).resolve())
