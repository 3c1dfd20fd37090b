"""In a real window: the scene check groups what it finds, notices changes, and is asked before a render."""

import pytest

from tests.support.window.desktop import NEEDS_WINDOW, SECONDS_TO_RENDER, TASK, monkey_window

pytestmark = NEEDS_WINDOW
ROWS = "[(row.code, row.title) for row in addon.check.last.rows()]"
CODES = "[row.code for row in addon.check.last.rows()]"
SECONDS_TO_CHECK = 30  # on a busy machine


@pytest.fixture(scope="module")
def window(tmp_path_factory):
    """One Blender for all steps, with an array in front of the monkey and the panel open."""
    with monkey_window(tmp_path_factory.mktemp("gui")) as window:
        window.run("bpy.ops.lfsr.array_fit('INVOKE_DEFAULT', True)")
        window.open_tab()
        yield window


CHECK = "bpy.ops.lfsr.check_scene('INVOKE_DEFAULT', True)"


def test_the_check_stays_of_the_scene_until_it_changes(window):
    window.run(CHECK)
    assert ["background", "Floor"] in window.get(ROWS)
    window.screenshot("check")
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
        window.run(f"row = next(row for row in addon.check.last.rows() if row.code == {code!r})")
        window.run("bpy.ops.lfsr.check_fix('INVOKE_DEFAULT', True, code=row.code, target=row.target)")
        assert code not in window.get(CODES)


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


def test_changes_of_an_opened_file_are_noticed_too(window):
    window.run("bpy.ops.wm.save_mainfile(); bpy.ops.wm.open_mainfile(filepath=FILE)")
    window.until("not bpy.context.window_manager.lfsr.checked_scene", SECONDS_TO_CHECK)
    window.run(CHECK)
    assert "motion" in window.get(CODES)
    window.run("bpy.context.scene.render.use_motion_blur = False")
    window.until("addon.check.last.has_changed()", SECONDS_TO_CHECK)
