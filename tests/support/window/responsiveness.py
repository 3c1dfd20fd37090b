"""How long Blender waits for the add-on, in ms, in a real window (see desktop.py):

    LFSR_WINDOW_BLENDER=DIR python tests/support/window/responsiveness.py 5000 50000

For each number of objects: what panels and 3D view cost per redraw, in CPU time, and how long *Render EIA* and *Render
Animation* hold the window before they return. Then the same buttons with 2 million triangles, beside saving alone.
"""

import statistics
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))

from tests.support.window.desktop import Window, blender_window

REDRAWS = 10
SCENE = """
import time
bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.lfsr.display, scene.lfsr.scale, scene.lfsr.method = "mini", "AUTO", "bilinear"   # nothing to ask
bpy.ops.wm.save_as_mainfile(filepath=FILE)
"""
MANY = """
mesh = bpy.data.meshes.new("Sheet")
mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [], [(0, 1, 2, 3)])
for number in range(COUNT):
    item = bpy.data.objects.new(f"Sheet {number}", mesh)
    item.location, item.scale = (number % 70 / 35 - 1, number // 70 % 70 / 35 - 1, number % 13 / 13 - 0.5), (0.01,) * 3
    scene.collection.objects.link(item)
"""
DENSE = "bpy.ops.mesh.primitive_grid_add(x_subdivisions=1000, y_subdivisions=1000)"
ARRAY = "bpy.ops.object.select_all(action='SELECT'); bpy.ops.lfsr.array_fit('INVOKE_DEFAULT', True)"
# Every draw function of the add-on, timed.
TIMED = """
import importlib
import time
from collections import defaultdict
times = defaultdict(list)
def timed(name, function, clock=time.thread_time):
    def wrapped(self=None, context=None):   # Blender counts the arguments of what it calls
        began = clock()
        try:
            return function(*(each for each in (self, context) if each is not None))
        finally:
            times[name].append(1000 * (clock() - began))
    return wrapped
ui = [importlib.import_module(f"{addon.__name__}.ui.{name}") for name in ("panels", "overlay")]
for cls in ui[0].CLASSES:
    cls.draw = timed(cls.bl_label, cls.draw)
addon.unregister()
ui[1].DRAWN = (("POST_VIEW", timed("3D view", ui[1].draw)),)
addon.register()
task = importlib.import_module(f"{addon.__name__}.jobs.task").Task
task.poll = timed("poll", task.poll, time.perf_counter)
"""
TAG = "for region in bpy.context.area.regions: region.tag_redraw()"
PRESS = """
began = time.perf_counter()
bpy.ops.lfsr.{button}("INVOKE_DEFAULT", True)
value = 1000 * (time.perf_counter() - began)
times.clear()
"""
SAVE = """
began = time.perf_counter()
bpy.ops.wm.save_as_mainfile(filepath=FILE + "1", copy=True, compress=False)
value = 1000 * (time.perf_counter() - began)
"""


def waits(window: Window) -> str:
    """Milliseconds of saving alone, until each button returns, and of the longest wait before its process runs."""
    found = [f"saving {window.run(SAVE):.0f}"]
    for button in ("render_eia", "render_animation"):
        pressed = window.run(PRESS.format(button=button))
        window.until("addon.jobs.session.current().child is not None", 300)
        longest = max(window.get("times.get('poll', [])"), default=0)
        found.append(f"{button} {pressed:.0f}, then {longest:.0f}")
        window.run("bpy.ops.lfsr.cancel()")
    return ", ".join(found)


def draws(window: Window) -> str:
    """Median milliseconds of CPU of each draw function."""
    window.settle()
    window.run("times.clear()")
    for _ in range(REDRAWS):
        window.run(TAG)
        window.settle()
    found = {name: statistics.median(times) for name, times in window.get("times").items()}
    return f"{sum(found.values()):.2f} ({', '.join(f'{name} {time:.2f}' for name, time in found.items())})"


def measure(counts: list[int]) -> None:
    """Print every figure."""
    with tempfile.TemporaryDirectory() as scratch, blender_window(Path(scratch)) as window:
        window.run(f"FILE = {str(Path(scratch, 'scene.blend'))!r}" + SCENE)
        window.run(TIMED)
        for count in counts:
            window.run(SCENE)
            window.open_tab()
            window.run(f"COUNT = {count}" + MANY + ARRAY)
            print(f"{count} objects: redraw {draws(window)}", flush=True)
            window.run("bpy.ops.lfsr.check_scene()")
            print(f"{count} objects, Scene Check: redraw {draws(window)}", flush=True)
            print(f"{count} objects: {waits(window)}", flush=True)
        window.run(SCENE)
        window.run(DENSE + "; " + ARRAY)
        print("2 million triangles:", waits(window))


if __name__ == "__main__":
    measure([int(count) for count in sys.argv[1:]])
