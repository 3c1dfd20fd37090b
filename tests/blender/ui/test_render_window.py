"""In a real window: what a render says while it runs and at its end, and that Blender's search finds the buttons."""

import re

import pytest

from tests.support.window.desktop import NEEDS_WINDOW, SECONDS_TO_RENDER, STATE, TASK, monkey_window

pytestmark = NEEDS_WINDOW
COUNT_POPUPS = """
popups = []
addon.jobs.session.tell = lambda *said: popups.append(said)
"""


@pytest.fixture(scope="module")
def window(tmp_path_factory):
    """One Blender with the panel open and an array fitted to the monkey."""
    with monkey_window(tmp_path_factory.mktemp("gui")) as window:
        window.open_tab()
        yield window


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
    assert window.get(f"addon.jobs.session.progress_text({TASK})") == "Opening the scene"
    window.screenshot("opening")
    window.until(f"{TASK} is None or {TASK}.seconds_left is not None", SECONDS_TO_RENDER)
    text = window.get(f"addon.jobs.session.progress_text({TASK})")
    assert re.fullmatch(r"Rendering \d+%, \d+:\d\d left", text)
    window.screenshot("rendering")


def test_a_cancel_says_how_to_go_on(window):
    window.run("bpy.ops.lfsr.cancel()")
    assert window.get(f"{STATE}.message").startswith("Cancelled") and not window.get(f"{STATE}.message_is_error")
    window.close_others()
    window.scroll_down()
    window.screenshot("cancelled")


def test_a_finished_render_is_a_quiet_line(window):
    window.run("bpy.context.scene.lfsr.samples = 2")
    search(window, "light field render eia")
    window.until(f"{TASK} is not None", 15)
    window.until(f"{TASK} is None", SECONDS_TO_RENDER)
    assert window.get(f"{STATE}.message").startswith("The pixel filter gaussian is ignored")
    assert window.get("popups") == []
    assert window.get(f"{STATE}.outcome").startswith("Done in 0:")
    window.close_others()
    window.scroll_down()
    window.screenshot("done")
