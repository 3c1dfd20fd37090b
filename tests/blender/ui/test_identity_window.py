"""In a real window without Open Image Denoise: whose image it is, and what a method needs."""

import shutil
from pathlib import Path

import pytest

from lfsr_core.frames.frame import read_frame, read_report
from lfsr_core.images.image_files import read_png
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, denoise
from tests.support.window.desktop import NEEDS_WINDOW, SECONDS_TO_RENDER, STATE, TASK, monkey_window

pytestmark = NEEDS_WINDOW
MESSAGE = f"{STATE}.message"
LFSR = "bpy.context.scene.lfsr"
SECONDS_TO_NOTICE = 30  # on a busy machine
LIBRARIES = ("libOpenImageDenoise.so.2", "libOpenImageDenoise_core.so.*", "libOpenImageDenoise_device_cpu.so.*",
             "libtbb.so.12")


@pytest.fixture(scope="module")
def window(tmp_path_factory):
    """One Blender with the tab open and an array fitted to the monkey."""
    with monkey_window(tmp_path_factory.mktemp("gui")) as window:
        window.open_tab()
        window.run("bpy.ops.lfsr.array_fit('INVOKE_DEFAULT', True)")
        yield window


def press_render(window) -> list[str]:
    window.xdotool("mousemove", 500, 450)
    if (pressed := window.get("list(bpy.ops.lfsr.render_eia('INVOKE_DEFAULT', True))")) != ["FINISHED"]:
        window.screenshot("ident-asked")
    return pressed


def until_done(window) -> None:
    window.until(f"{TASK} is None", SECONDS_TO_RENDER)
    window.close_others()


def save(window, path: Path) -> None:
    path.parent.mkdir(exist_ok=True)
    window.run(f"bpy.ops.wm.save_as_mainfile(filepath={str(path)!r})")


def test_another_files_image_is_not_shown_and_overwritten_only_after_a_question(window):
    renders = window.folder / "renders"
    window.run(f"{LFSR}.output = {str(renders)!r}")
    save(window, window.folder / "one" / "shot.blend")
    assert press_render(window) == ["FINISHED"]
    until_done(window)
    folder = renders / "shot" / "Scene" / "0001"
    first = read_png(folder / "eia.png")

    window.run("bpy.data.objects['Suzanne'].rotation_euler.z = 1")
    save(window, window.folder / "two" / "shot.blend")
    said = window.run("""
try:
    bpy.ops.lfsr.preview_view('INVOKE_DEFAULT', True)
except RuntimeError as error:
    value = str(error)
""")
    assert "is an image of another scene, 'Scene' of shot.blend in the folder one: render the EIA first" in said

    assert press_render(window) == ["RUNNING_MODAL"]
    window.screenshot("ident-1-overwrite")
    window.xdotool("key", "Escape")
    assert window.get(f"{TASK} is None") and (read_png(folder / "eia.png") == first).all()
    assert press_render(window) == ["RUNNING_MODAL"]
    window.xdotool("key", "Return")
    until_done(window)
    assert "pixel filter gaussian" in window.get(MESSAGE) and (read_png(folder / "eia.png") != first).any()
    assert read_frame(folder).source == "../../../../two/shot.blend"
    assert press_render(window) == ["FINISHED"], "it is this file's now"
    until_done(window)


def test_what_the_method_needs_is_asked_before_the_render(window):
    window.run(f"{LFSR}.output = '//lightfield/'; {LFSR}.method = {DEFAULT_METHOD!r}")
    window.run("bpy.ops.lfsr.check_scene('INVOKE_DEFAULT', True)")
    assert window.get("[(p.code, p.fix) for p in addon.check.last.rows]")[0] == ["denoise", "Use Pool"]
    window.screenshot("ident-2-check")
    assert press_render(window) == ["RUNNING_MODAL"]
    window.screenshot("ident-3-asked")
    window.xdotool("key", "Escape")
    folder = window.folder / "two" / "lightfield"
    assert not folder.exists() and window.get(f"{LFSR}.method") == DEFAULT_METHOD
    assert press_render(window) == ["RUNNING_MODAL"]
    window.xdotool("key", "Return")
    until_done(window)
    assert window.get(f"{LFSR}.method") == "pool" and read_report(folder / "shot" / "Scene" / "0001").method == "pool"


def test_a_library_of_the_preferences_denoises(window):
    library = next(path for path in denoise.find_libraries() if path.is_file())
    (window.folder / "oidn" / "lib").mkdir(parents=True)  # where the libraries look for each other
    for name in LIBRARIES:
        for path in library.parent.glob(name):
            shutil.copy(path, window.folder / "oidn" / "lib")
    chosen = str(window.folder / "oidn" / "lib" / library.name)
    window.run(f"bpy.context.preferences.addons['bl_ext.user_default.lfsr'].preferences.oidn_path = {chosen!r}\n"
               f"{LFSR}.method = {DEFAULT_METHOD!r}; bpy.context.scene.frame_set(2)")
    assert press_render(window) == ["FINISHED"]
    until_done(window)
    assert "pixel filter gaussian" in window.get(MESSAGE)
    assert read_report(window.folder / "two" / "lightfield" / "shot" / "Scene" / "0002").method == DEFAULT_METHOD
    window.screenshot("ident-4-denoised")


@pytest.mark.parametrize("before", [
    "", "bpy.ops.wm.save_mainfile(); bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)"])
def test_changed_settings_are_noticed_also_in_a_file_that_was_opened(window, before):
    window.run(before)
    for change in ("render.use_motion_blur", "view_layers[0].use", "view_settings.use_curve_mapping"):
        window.run("bpy.ops.lfsr.check_scene('INVOKE_DEFAULT', True)")
        assert not window.get("addon.check.last.changed"), "what the check writes is no change of the scene"
        window.run(f"scene = bpy.context.scene; scene.{change} = not scene.{change}")
        window.until("addon.check.last.changed", SECONDS_TO_NOTICE)
