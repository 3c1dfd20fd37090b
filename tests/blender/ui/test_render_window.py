"""In a real window: what a render says while it runs and at its end, and that Blender's search finds the buttons."""

from __future__ import annotations

import os
import re
import shutil

import pytest

from tests.blender.ui.test_window import SCENE, SECONDS_TO_RENDER
from tests.support.window.desktop import VARIABLE, blender_window

pytestmark = [pytest.mark.window, pytest.mark.skipif(
    VARIABLE not in os.environ, reason=f"no {VARIABLE}: scripts/window_blender.sh makes a Blender with a window")]
TASK = "addon.background.session.current()"
STATE = "bpy.context.window_manager.lfsr"
CLOSE_OTHERS = """
for other in list(bpy.context.window_manager.windows)[1:]:
    with bpy.context.temp_override(window=other):
        bpy.ops.wm.window_close()
"""
COUNT_POPUPS = """
popups = []
addon.background.session.tell = lambda *said: popups.append(said)
"""


@pytest.fixture(scope="module")
def window(tmp_path_factory):
    """One Blender with the panel open and an array fitted to the monkey."""
    folder = tmp_path_factory.mktemp("gui")
    with blender_window(folder) as window:
        window.run(f"FILE = {str(folder / 'scene.blend')!r}" + SCENE)
        window.open_tab()
        yield window
    kept = os.environ.get("LFSR_SCREENSHOTS")
    for picture in folder.glob("*.png") if kept else ():
        shutil.copy(picture, kept)


def scroll_down(window) -> None:
    """Turn the wheel over the sidebar until its end."""
    x, width = window.get("[(r.x, r.width) for r in bpy.context.area.regions if r.type == 'UI'][0]")
    window.xdotool("mousemove", x + width // 2, 600)
    window.xdotool("click", "--repeat", 12, "--delay", 20, 5)


def search(window, query: str) -> None:
    """Search for ``query`` and press Return on what is found first."""
    window.xdotool("mousemove", 400, 500)
    assert window.get("list(bpy.ops.wm.search_menu('INVOKE_DEFAULT'))") == ["INTERFACE"]   # as F3 does
    window.settle()
    window.xdotool("type", "--delay", "60", query)
    window.screenshot(f"search-{query.replace(' ', '-')}")
    window.xdotool("key", "Return")


def test_the_search_finds_the_camera_array(window):
    search(window, "camera array")
    assert window.until("[item.name for item in bpy.data.objects if 'lfsr_spacing' in item]", 15)
    window.run("bpy.ops.lfsr.array_fit('INVOKE_DEFAULT', True)")


def test_the_search_finds_the_render_and_it_says_how_long_it_takes(window):
    window.run(COUNT_POPUPS + "bpy.context.scene.lfsr.samples = 512")
    search(window, "render eia")
    window.until(f"{TASK} is not None", 15)
    assert window.get(f"addon.background.session.progress_text({TASK})") == "Opening the scene"
    window.screenshot("opening")
    window.until(f"{TASK} is None or {TASK}.seconds_left is not None", SECONDS_TO_RENDER)
    text = window.get(f"addon.background.session.progress_text({TASK})")
    assert re.fullmatch(r"(Proof|Rendering) \d+%, \d+:\d\d left", text)
    window.screenshot("rendering")


def test_a_cancel_says_how_to_go_on(window):
    window.run("bpy.ops.lfsr.cancel()")
    assert window.get(f"{STATE}.message").startswith("Cancelled") and not window.get(f"{STATE}.message_is_error")
    scroll_down(window)
    window.screenshot("cancelled")


def test_a_finished_render_is_a_quiet_line(window):
    window.run("bpy.context.scene.lfsr.samples = 2")
    search(window, "light field render eia")
    window.until(f"{TASK} is not None", 15)
    window.until(f"{TASK} is None", SECONDS_TO_RENDER)
    assert window.get(f"{STATE}.message") == "" and window.get("popups") == []
    assert window.get(f"{STATE}.outcome").startswith("Done in 0:")
    window.run(CLOSE_OTHERS)
    scroll_down(window)
    window.screenshot("done")
