"""Scenes of the live view's tests, as Python that runs in the window's Blender (see agent.py)."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.window.desktop import SCRIPTS, Window

SAMPLES, SAMPLES_OF_HARD_SCENES = 256, 2048   # two noisy images are compared
DEMO = SCRIPTS / "lab" / "lfsr_lab" / "scenes" / "demo_scene.py"
CORNELL = SCRIPTS.parents[1] / "shared" / "assets" / "scenes" / "cornell" / "CornellBox.blend"
SCENE = """
def make_scene(path):
    scene = bpy.context.scene
    bpy.data.batch_remove(scene.objects)
    bpy.ops.mesh.primitive_monkey_add(location=(0, 0, 1))
    bpy.ops.object.shade_smooth()
    paint = bpy.data.materials.new("Paint")
    paint.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.8, 0.25, 0.06, 1)
    bpy.context.object.data.materials.append(paint)
    bpy.ops.mesh.primitive_plane_add(size=60, location=(0, 0, -0.2))
    bpy.ops.object.light_add(type="AREA", radius=3, location=(3, -4, 5))
    bpy.context.object.data.energy = 600
    scene.render.engine, scene.render.film_transparent = "CYCLES", True
    for item in scene.objects:
        item.select_set(item.name == "Suzanne")
    lfsr = scene.lfsr
    lfsr.display, lfsr.scale, lfsr.live_scale, lfsr.method = "mini", "2", "2", "bilinear"
    lfsr.samples = lfsr.live_samples = SAMPLES
    lfsr.live_denoise = bpy.context.space_data.shading.use_scene_world_render = False  # as an artist may leave it
    bpy.context.space_data.shading.cycles.render_pass = "NORMAL"
    bpy.ops.lfsr.array_fit('EXEC_DEFAULT', True)
    bpy.ops.wm.save_as_mainfile(filepath=path)
"""
ANOTHER = """
bpy.ops.wm.open_mainfile(filepath=path, load_ui=False)
scene = bpy.context.scene
for item in scene.objects:
    for modifier in item.modifiers:
        if modifier.type == "SUBSURF":
            modifier.levels = modifier.render_levels
scene.render.engine = "CYCLES"
lfsr = scene.lfsr
lfsr.samples = lfsr.live_samples = samples
lfsr.live_denoise = False
bpy.ops.lfsr.array_add('EXEC_DEFAULT', True)
for item in scene.objects:
    item.select_set(False)   # the array stays where it was added
bpy.ops.wm.save_as_mainfile(filepath=kept)
"""


def another_scene(window: Window, name: str) -> None:
    """The generated demo scene (glass, metal, a world of light), or the Cornell box with its own camera."""
    if name == "demo":
        copy = window.folder / "demo.blend"
        subprocess.run([sys.executable, DEMO, copy], check=True, capture_output=True)
    elif CORNELL.is_file():
        copy = Path(shutil.copy(CORNELL, window.folder))
    else:
        pytest.skip(f"no {CORNELL}: the assets are not here")
    kept = window.folder / f"{name}.kept.blend"
    window.run(f"path, kept, samples = {str(copy)!r}, {str(kept)!r}, {SAMPLES_OF_HARD_SCENES}" + ANOTHER)
    window.settle()
