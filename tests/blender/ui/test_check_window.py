"""In a real window: the scene check groups what it finds, notices changes, and is asked before a render."""

import time

import pytest

from tests.blender.ui.test_window import SCENE, SECONDS_TO_RENDER
from tests.support.window.desktop import NEEDS_WINDOW, blender_window

pytestmark = NEEDS_WINDOW
TASK = "addon.jobs.session.current()"
ROWS = "[(row.code, row.title) for row in bpy.context.window_manager.lfsr.problems]"
CODES = "[row.code for row in bpy.context.window_manager.lfsr.problems]"
RODS = """
mesh = bpy.data.objects["Suzanne"].data
for number in range(300):
    rod = bpy.data.objects.new(f"Rod {number:03d}", mesh)
    rod.scale, rod.location = (0.001, 0.001, 0.3), (number % 20 / 20 - 0.5, 0, 0.5 + number // 20 / 20)
    bpy.context.scene.collection.objects.link(rod)
"""
SECONDS_TO_CHECK = 30  # on a busy machine


@pytest.fixture(scope="module")
def window(tmp_path_factory):
    """One Blender for all steps, with an array in front of the monkey and the panel open."""
    folder = tmp_path_factory.mktemp("gui")
    with blender_window(folder) as window:
        window.run(f"FILE = {str(folder / 'scene.blend')!r}" + SCENE)
        window.run("bpy.ops.lfsr.array_fit('INVOKE_DEFAULT', True)")
        window.open_tab()
        yield window


CHECK = "bpy.ops.lfsr.check_scene('INVOKE_DEFAULT', True)"


def test_the_check_stays_of_the_scene_until_it_changes(window):
    window.run(CHECK)
    assert ["background", "Floor"] in window.get(ROWS)
    window.screenshot("check")
    time.sleep(2)
    assert not window.get("addon.check.last.has_changed()"), "what the check writes is no change of the scene"


@pytest.mark.parametrize("change, code", [
    ("scene.render.use_motion_blur = True", "motion"), ("scene.view_layers.new('Second')", "layers"),
    ("bpy.data.objects['Suzanne'].hide_render = bpy.data.objects['Floor'].hide_render = True", "subject"),
    ("scene.view_settings.use_curve_mapping = True", "view")])
def test_a_change_is_noticed(window, change, code):
    assert code not in window.get(CODES)
    window.run(f"scene = bpy.context.scene; {change}")
    window.until("addon.check.last.has_changed()", SECONDS_TO_CHECK)
    window.run(CHECK)
    assert code in window.get(CODES)
    window.screenshot(f"check-{code}")
    if code != "motion":
        window.run(f"row = next(row for row in bpy.context.window_manager.lfsr.problems if row.code == {code!r})")
        window.run("bpy.ops.lfsr.check_fix('INVOKE_DEFAULT', True, code=row.code, target=row.target)")
        assert code not in window.get(CODES)


def test_many_objects_are_one_row(window):
    window.run(RODS)
    window.run(CHECK)
    assert ["thin", "300 objects are too thin"] in window.get(ROWS)
    window.run("next(row for row in bpy.context.window_manager.lfsr.problems if row.code == 'thin').expanded = True")
    window.run("addon.jobs.show_image.redraw_views()")
    window.screenshot("check-thin")
    window.run("bpy.ops.lfsr.check_select('INVOKE_DEFAULT', True, code='thin')")
    assert window.get("len(bpy.context.selected_objects)") == 300
    window.run("for item in bpy.context.selected_objects: bpy.data.objects.remove(item)")


def test_a_render_asks_first_and_only_once(window):
    assert window.get("list(bpy.ops.lfsr.render_eia('INVOKE_DEFAULT', True))") == ["RUNNING_MODAL"]
    window.settle()
    window.screenshot("check-asks")
    assert window.get(f"{TASK} is None")
    window.xdotool("key", "Return")
    window.until(f"{TASK} is not None", SECONDS_TO_CHECK)
    window.run("bpy.ops.lfsr.cancel()")
    assert window.get("list(bpy.ops.lfsr.render_eia('INVOKE_DEFAULT', True))") == ["FINISHED"]
    window.until(f"{TASK} is None", SECONDS_TO_RENDER)
    window.settle()


def test_the_time_is_measured_with_a_few_lenses(window):
    assert window.get("list(bpy.ops.lfsr.estimate_time('INVOKE_DEFAULT', True))") == ["FINISHED"]
    window.until(f"{TASK} is None", SECONDS_TO_RENDER)
    assert window.get("bpy.context.window_manager.lfsr.message") == ""
    seconds = window.get("addon.jobs.asked.expected_seconds(bpy.context.scene)")
    window.run("bpy.context.scene.lfsr.samples *= 1000")
    assert 0 < seconds < window.get("addon.jobs.asked.expected_seconds(bpy.context.scene)")
    window.close_others()
    window.run("addon.jobs.show_image.redraw_views()")
    window.screenshot("check-time")
    window.run("bpy.context.scene.lfsr.samples //= 1000")


def test_changes_of_an_opened_file_are_noticed_too(window):
    window.run("bpy.ops.wm.save_mainfile(); bpy.ops.wm.open_mainfile(filepath=FILE)")
    window.until("not bpy.context.window_manager.lfsr.checked_scene", SECONDS_TO_CHECK)
    window.run(CHECK)
    assert "motion" in window.get(CODES)
    window.run("bpy.context.scene.render.use_motion_blur = False")
    window.until("addon.check.last.has_changed()", SECONDS_TO_CHECK)
