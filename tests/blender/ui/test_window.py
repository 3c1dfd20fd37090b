"""The installed extension in a real window, as tests/support/window/desktop.py says: what an artist does.

    LFSR_WINDOW_BLENDER=DIR python -m pytest -m window
"""

import shutil
import time

import numpy as np
import pytest

from lfsr_core.frames.frame import read_frame
from lfsr_core.images.image_files import read_png
from tests.support.window.desktop import NEEDS_WINDOW, SECONDS_TO_RENDER, Window, monkey_window

pytestmark = NEEDS_WINDOW
SECONDS_TO_ANSWER = 15   # also on a busy machine without a graphics card
DISPLAY_COLOR = (92, 199, 255)
UNTOUCHED = ("(scene.render.resolution_x, scene.cycles.samples, scene.cycles.pixel_filter_type, scene.render.engine, "
             "scene.camera.name, len(scene.objects), len(bpy.data.cameras), scene.render.filepath)")


@pytest.fixture(scope="module")
def window(tmp_path_factory):
    """One Blender for all steps, which build on each other as an artist's do."""
    with monkey_window(tmp_path_factory.mktemp("gui")) as window:
        yield window


def scene_value(window: Window, expression: str):
    """Value of an expression about ``scene`` and its settings ``lfsr``."""
    return window.run(f"scene = bpy.context.scene; lfsr = scene.lfsr; value = {expression}")


OPEN = """
panel = bpy.types.LFSR_PT_quality
bpy.utils.register_class(type("LFSR_PT_quality_open", panel.__bases__, {
    "bl_idname": "LFSR_PT_quality_open", "bl_label": "Quality", "bl_order": -1, "bl_options": set(),
    "draw": panel.draw}))
"""


def test_light_is_chosen_from_its_menu(window):
    window.run(OPEN)  # a panel keeps whether it is open, so another with the same contents is added
    x, top, width, height = window.open_tab()
    sidebar, pictures = np.s_[top:top + height, x:x + width], []
    for light in ("AUTO", "OWN"):
        window.run(f"bpy.context.scene.lfsr.light = {light!r}; bpy.context.area.tag_redraw()")
        window.xdotool("mousemove", x - 200, 600)
        pictures.append(read_png(window.screenshot(f"light-{light}"))[sidebar])
    rows, columns, _ = np.nonzero(pictures[0] != pictures[1])
    assert np.ptp(rows) < 30, "one button of the sidebar shows the light"
    window.click(int(x + columns.mean()), int(top + rows.mean()))
    opened = read_png(window.screenshot("light-menu"))[sidebar]
    assert (opened != pictures[1]).any(-1).sum() > 20_000, "the menu covers a large part of it"
    for key in ("Home", "Down", "Down", "Return"):
        window.xdotool("key", key)
    assert scene_value(window, "lfsr.light") == "EVEN"
    window.run("bpy.context.scene.lfsr.light = 'FILE'; bpy.context.area.tag_redraw()")
    window.screenshot("light-file")
    with pytest.raises(AssertionError, match="No light file is chosen: give a .hdr or .exr file"):
        window.run("bpy.ops.lfsr.render_eia('INVOKE_DEFAULT', True)")
    window.run("bpy.context.scene.lfsr.light = 'EVEN'; bpy.utils.unregister_class(bpy.types.LFSR_PT_quality_open)")
    window.run("if 'Display Plane' in bpy.data.objects: bpy.ops.lfsr.array_remove('INVOKE_DEFAULT', True)")


@pytest.mark.parametrize(("query", "condition"), [
    ("camera array", "[item for item in bpy.data.objects if 'lfsr_spacing' in item] != []"),
    ("light field render eia", "addon.jobs.session.current() is not None")])
def test_blenders_search_finds_the_buttons(window, query, condition):
    """Return is pressed on what is found first."""
    window.xdotool("mousemove", 400, 500)
    assert window.get("list(bpy.ops.wm.search_menu('INVOKE_DEFAULT'))") == ["INTERFACE"]  # as F3 does
    window.settle()
    window.xdotool("type", "--delay", "60", query)
    window.screenshot(f"search-{query.replace(' ', '-')}")
    window.xdotool("key", "Return")
    window.until(condition, SECONDS_TO_ANSWER)
    window.run("bpy.ops.lfsr.cancel()")
    window.close_others()


def test_array_is_added_and_drawn(window):
    # Whatever a test before has added is not seen.
    window.run("bpy.context.scene.lfsr.show_frustum = False; bpy.ops.view3d.view_axis(type='RIGHT')")
    before = read_png(window.screenshot("3-before"))
    assert window.get("list(bpy.ops.lfsr.array_fit('INVOKE_DEFAULT', True))") == ["FINISHED"]
    window.run("bpy.context.scene.lfsr.show_frustum = True")
    drawn = read_png(window.screenshot("4-array"))
    window.run("bpy.context.scene.lfsr.show_frustum = False")
    hidden = read_png(window.screenshot("5-hidden"))
    # Pixels in the colour of the display rectangle.
    blue = [(np.abs(picture.astype(int) - DISPLAY_COLOR).max(-1) < 40).sum() for picture in (before, drawn, hidden)]
    assert blue[1] > 100 and blue[0] < blue[1] / 5 and blue[2] < blue[1] / 5
    window.run("bpy.context.scene.lfsr.show_frustum = True")


def test_display_plane_is_one_handle(window):
    if not window.get("'Display Plane' in bpy.data.objects"):
        window.run("bpy.ops.lfsr.array_fit('INVOKE_DEFAULT', True)")
    window.run("bpy.ops.lfsr.select_plane('INVOKE_DEFAULT', True)")
    distance = scene_value(window, "lfsr.distance")
    window.xdotool("mousemove", 500, 500)
    for key in ("g", "z", "z", "1", "Return"):   # grab along the local Z axis by 1
        window.xdotool("key", key)
    assert scene_value(window, "lfsr.distance") == pytest.approx(distance - 1, abs=1e-3)
    assert scene_value(window, "list(bpy.data.objects['Display Plane'].location)[:2]") == [0, 0]
    window.xdotool("key", "ctrl+z")
    assert scene_value(window, "lfsr.distance") == pytest.approx(distance, abs=1e-3)


def test_render_keeps_the_window_alive_and_the_scene_as_it_was(window):
    before, started = scene_value(window, UNTOUCHED), time.monotonic()
    assert window.get("list(bpy.ops.lfsr.render_eia('INVOKE_DEFAULT', True))") == ["FINISHED"]
    returned = time.monotonic() - started
    task, message = "addon.jobs.session.current()", "bpy.context.window_manager.lfsr.message"
    window.until(f"{task} is None or {task}.fraction > 0", SECONDS_TO_RENDER)
    ended, said = window.get(f"({task} is None, {message})")
    assert ended or said == ""
    window.screenshot("7-rendering")
    # A person works on meanwhile: the answer comes at once.
    asked = time.monotonic()
    window.get("bpy.context.scene.frame_current")
    answered = time.monotonic() - asked
    window.until("addon.jobs.session.current() is None", SECONDS_TO_RENDER)
    assert window.get(message).startswith("The pixel filter gaussian is ignored")
    assert scene_value(window, UNTOUCHED) == before
    assert returned < SECONDS_TO_ANSWER and answered < SECONDS_TO_ANSWER
    folder = window.folder / "lightfield" / "scene" / "Scene" / "0001"
    assert read_png(folder / "eia.png").shape == (96, 128, 3) and read_frame(folder).light == "even"
    window.settle()
    window.screenshot("8-rendered")
    assert window.get("addon.jobs.images.icon(bpy.context.scene) and len(bpy.context.window_manager.windows)") == 1


LONG = "'mini', '2', 100_000"  # samples, so that a render is under way when it is stopped
WIDE = "'bupt-32in-8k', '8', 1"  # whose second stage takes seconds, and the task is looked at ten times in one


@pytest.mark.parametrize(("moment", "settings", "is_there"), [
    ("opening", LONG, "True"), ("rendering", LONG, "task.progress.stage == 'render'"),
    ("upscaling", WIDE, "task.progress.stage in ('load', 'upscale', 'write')")])
def test_cancel_is_quick_and_tidy(window, moment, settings, is_there):
    before = scene_value(window, UNTOUCHED)
    window.run(f"lfsr = bpy.context.scene.lfsr; lfsr.display, lfsr.scale, lfsr.samples = {settings}")
    window.run("scene = bpy.context.scene\nscene.frame_set(7)")
    window.run("for asked in addon.ui.operators.render.check_questions(scene):\n    asked.accept()")
    window.run("bpy.ops.lfsr.render_eia('INVOKE_DEFAULT', True)")
    # Waits inside Blender: on a busy machine the moment could pass between two questions from here.
    window.run(f"""
import os, time
ended = []
def cancel_then():
    task = addon.jobs.session.current()
    if task is None:
        ended.append(None)
    if ended or not task.child or not ({is_there}):
        return None if ended else 0.002
    pid, started = task.child.pid, time.perf_counter()
    bpy.ops.lfsr.cancel()
    ended.append((time.perf_counter() - started, os.path.exists(f"/proc/{{pid}}")))
bpy.app.timers.register(cancel_then)
""")
    window.until("bool(ended)", SECONDS_TO_RENDER)
    seconds, pid_alive = window.get("ended[0]")
    print(f"cancel while {moment}: {seconds:.2f} s")
    assert seconds < 2 and not pid_alive
    window.run("lfsr.display, lfsr.scale, lfsr.samples = 'mini', '2', 2")
    assert scene_value(window, UNTOUCHED) == before
    kept = ["0007"] if moment == "upscaling" else []  # the render, to be finished
    frames = window.folder / "lightfield" / "scene" / "Scene"
    assert sorted(path.name for path in frames.iterdir()) == ["0001", *kept]
    shutil.rmtree(frames / "0007", ignore_errors=True)


def test_quitting_asks_nothing(window):
    """About the view that was previewed, that is: a file that was not saved is asked about."""
    window.run("bpy.context.scene.frame_set(1)")
    assert window.get("list(bpy.ops.lfsr.preview_view('INVOKE_DEFAULT', True))") == ["FINISHED"]
    window.run("bpy.ops.wm.save_mainfile()")
    assert window.get("'Light Field View' in bpy.data.images and not bpy.data.is_dirty")
    window.run("""
def leave():
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        bpy.ops.wm.quit_blender("INVOKE_DEFAULT")
bpy.app.timers.register(leave, first_interval=0.5)
""")
    assert window.process.wait(SECONDS_TO_ANSWER) == 0
