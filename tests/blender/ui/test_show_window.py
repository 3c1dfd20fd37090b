"""In a real window: Show on Display after a render for each kind of display, and a calibration, with a stand-in."""

import contextlib
import time

import numpy as np
import pytest

from lfsr_core.calibration.patterns import pattern
from lfsr_core.exports import loopback
from lfsr_core.frames.frame import read_frame
from lfsr_core.images.image_files import read_png
from lfsr_core.optics.display import write_profile
from tests.calibration.test_fit import CYLINDERS, GOOD, PLACE
from tests.calibration.test_makers import OLD
from tests.support.bridge import device, stand_in
from tests.support.panels import cells, lenticular, small
from tests.support.processes import wait_for
from tests.support.telephone import jpeg
from tests.support.window.desktop import NEEDS_WINDOW, SECONDS_TO_RENDER, STATE, TASK, monkey_window

pytestmark = NEEDS_WINDOW
UNIT = device(1, "LKG-S1", "small", OLD | {"screenW": 120, "screenH": 80})
SHEETS = {"lenticular": lenticular, "third-generation": cells}
SECONDS_TO_ANSWER, SECONDS_TO_SHOW = 15, 120


@pytest.fixture(scope="module")
def bridges():
    """Change what Blender finds on its port: ``bridges(window, "hang:show_window")``."""
    with contextlib.ExitStack() as stack:
        def start(window, *faults):
            server = stack.enter_context(stand_in([UNIT], *faults))
            window.run(f"import os; os.environ[{loopback.PORT_VARIABLE!r}] = '{server.server_port}'")
            return server
        yield start


@pytest.fixture(scope="module")
def window(tmp_path_factory):
    """One Blender with the panel open, an array fitted to the monkey, and a browser that notes what it opens."""
    folder = tmp_path_factory.mktemp("gui")
    for name, sheet in SHEETS.items():
        write_profile(folder / f"{name}.toml", small(sheet()))
    (folder / "browser.sh").write_text(f'echo "$1" >> {folder}/opened.txt\n')
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BROWSER", f"sh {folder}/browser.sh %s")
        patch.setenv(loopback.PORT_VARIABLE, "1")  # nobody listens there
        with monkey_window(folder) as window:
            # *View and Export* is closed at first, as the artist's click would leave it open.
            window.run("section = addon.ui.panels.LFSR_PT_exports\nbpy.utils.unregister_class(section)\n"
                       "section.bl_options = set()\nbpy.utils.register_class(section)")
            window.open_tab()
            window.run("bpy.ops.lfsr.array_fit('INVOKE_DEFAULT', True)")
            yield window


def render(window, name: str) -> None:
    """Render for the display of this name, and close the image's window."""
    window.run(f"lfsr = bpy.context.scene.lfsr\nlfsr.display = 'mini' if {name!r} == 'mini' else 'FILE'\n"
               f"lfsr.profile_file = {str(window.folder / name)!r} + '.toml'\nlfsr.use_overwrite = True\n"
               "lfsr.scale = '2'\nbpy.ops.lfsr.render_eia('INVOKE_DEFAULT', True)")
    window.until(f"{TASK} is None", SECONDS_TO_RENDER)
    assert not window.get(f"{STATE}.message_is_error")
    window.close_others()
    window.scroll_down()
    window.xdotool("mousemove", 400, 500)


def press(window) -> None:
    """Click on *Show on Display*: the row that gains a button where there is another way to show the image."""
    window.run(f"{STATE}.message = ''")
    window.scroll_down()
    window.xdotool("mousemove", 400, 500)
    x, top, width, height = window.get("[(r.x, bpy.context.window.height - r.y - r.height, r.width, r.height) "
                                       "for r in bpy.context.area.regions if r.type == 'UI'][0]")
    sidebar, pictures = np.s_[top:top + height, x:x + width], []
    window.run("settings, has = addon.scene.settings, addon.scene.settings.has_quilts")
    for answer in ("False", "True"):
        window.run(f"settings.has_quilts = lambda _: {answer}; addon.jobs.session.redraw()")
        pictures.append(read_png(window.screenshot("row"))[sidebar])
    window.run("settings.has_quilts = has; addon.jobs.session.redraw()")
    rows, _, _ = np.nonzero(pictures[0] != pictures[1])
    assert rows.size and np.ptp(rows) < 40, "one row of buttons changes"
    window.click(x + 80, int(top + rows.mean()))
    window.until(f"{TASK} is not None or {STATE}.message", SECONDS_TO_ANSWER)


def shown(window) -> str:
    """Wait for the end; what the panel says then. The same sentence beside the pointer is closed."""
    window.until(f"{TASK} is None", SECONDS_TO_SHOW)
    window.xdotool("key", "Escape")
    window.xdotool("mousemove", 400, 500)
    return window.get(f"{STATE}.message")


def test_a_lens_array_is_opened_in_the_browser(window):
    render(window, "mini")
    press(window)
    assert shown(window).startswith("The browser shows it full screen: move its window")
    page = window.folder / "lightfield" / "scene" / "Scene" / "0001" / "show.html"
    opened = window.folder / "opened.txt"
    wait_for(lambda: opened.is_file() and opened.read_text(), SECONDS_TO_ANSWER)
    assert opened.read_text().split() == [page.as_uri()] and page.is_file()
    window.scroll_down()
    window.screenshot("show-lens-array")


@pytest.mark.parametrize("name", SHEETS)
def test_a_lenticular_display_shows_a_quilt_through_bridge(window, bridges, name):
    stand_in = bridges(window)
    render(window, name)
    press(window)
    message = shown(window)
    window.scroll_down()
    window.screenshot(f"show-{name}")
    assert message.endswith("is shown on LKG-S1 (small)") and not window.get(f"{STATE}.message_is_error")
    (quilt,) = stand_in.shown
    assert read_png(quilt).std() > 5
    window.xdotool("mousemove", 900, 600)
    window.xdotool("click", "--repeat", 30, "--delay", 20, 4)
    window.screenshot(f"show-{name}-top")  # which display it is
    window.run("bpy.ops.lfsr.show('INVOKE_DEFAULT', True, full_screen=True)")
    assert shown(window).startswith("The browser shows it full screen")
    frame = window.folder / "lightfield" / "scene" / "Scene" / "0001"
    assert bool(read_frame(frame).display.pixel_layout.cells) == (name == "third-generation")
    assert (frame / "panel.png").as_uri() in (frame / "show.html").read_text()
    assert read_png(frame / "panel.png").std() > 5


def test_while_bridge_hangs_blender_does_not(window, bridges):
    stand_in = bridges(window, "hang:available_output_devices")
    press(window)
    ends = time.monotonic() + SECONDS_TO_SHOW
    while "available_output_devices" not in stand_in.endpoints:
        assert time.monotonic() < ends
        time.sleep(0.1)
    asked = time.monotonic()
    assert window.get(f"{TASK}.progress.stage") == "show" and time.monotonic() - asked < loopback.SECONDS / 2
    window.screenshot("show-hangs")
    assert shown(window) == ("Looking Glass Bridge did not answer available_output_devices within 10 s: end it and "
                             "start it again")


@pytest.mark.parametrize(("name", "faults", "message"), [
    ("none", None, "Looking Glass Bridge is not running: nothing listens on port 1 of this computer"),
    ("refuses", ["refuse:play_playlist"], "Looking Glass Bridge refuses play_playlist (Failure: display is")])
def test_a_failure_is_a_sentence_in_the_panel(window, bridges, name, faults, message):
    if faults is None:
        window.run(f"import os; os.environ[{loopback.PORT_VARIABLE!r}] = '1'")
    else:
        bridges(window, *faults)
    press(window)
    assert shown(window).startswith(message) and window.get(f"{STATE}.message_is_error")
    window.screenshot(f"show-{name}")


def test_a_photograph_calibrates_the_display_and_the_prediction_is_shown(window):
    folder = window.folder
    write_profile(folder / "own.toml", CYLINDERS)
    (folder / "photo.jpg").write_bytes(jpeg(pattern(CYLINDERS, "phase"), CYLINDERS, GOOD))
    window.run(f"lfsr.display, lfsr.profile_file = 'FILE', {str(folder / 'own.toml')!r}")
    before = read_png(window.screenshot("calibration-1-before"))
    window.run(f"bpy.ops.lfsr.calibrate(files=[{{'name': 'photo.jpg'}}], directory={str(folder)!r}, place={PLACE})")
    after = read_png(window.screenshot("calibration-2-after"))
    assert (folder / "large-calibrated.toml").exists()
    assert before.shape == after.shape and np.mean(before != after) > 0.05, "the prediction's window"
