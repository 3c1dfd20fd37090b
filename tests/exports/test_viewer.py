"""Pages in a real browser: the viewer against the simulated eye, what a person can do with it, and the full screen."""

import base64
import dataclasses
import itertools
import math
import re

import cv2
import numpy as np
import pytest

from lfsr_core.exports.light_field import read_light_field
from lfsr_core.exports.page import write_page
from lfsr_core.exports.show import write_screen_page
from lfsr_core.frames.frame import read_frame
from lfsr_core.images.image_files import read_png, write_png
from lfsr_core.optics.eye import eye_view
from lfsr_core.optics.rays import view_offset
from tests.support.browser import CHROMIUM, Page, needs_chromium
from tests.support.finished import DIRECT, MINI, TALL, finished

pytestmark = needs_chromium
ZONE = MINI.camera_spacing_mm * 8
NINE = [(x * ZONE * 0.37, y * ZONE * 0.31, z * MINI.viewing_distance_mm)
        for x, y, z in ((0, 0, 1), (-1, 0, 1), (1, 0, 1), (0, 1, 1), (0, -1, 1), (-1, 1, 0.8), (1, -1, 1.3),
                        (1.8, 0.1, 1), (0.1, -0.2, 0.6))]


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    root = tmp_path_factory.mktemp("frames")
    return {display.name: finished(root / display.name, display) for display in (MINI, TALL, DIRECT)}


@pytest.fixture
def opened(browser, folders):
    """Open a display's frame in a page; pages close at the end, and none may have complained."""
    pages = []

    def opening(name, options="", quality=None, **context):
        pages.append(Page(browser, write_page([folders.get(name, name)], quality=quality).path, options, **context))
        return pages[-1]
    yield opening
    for page in pages:
        page.close()
        assert page.complaints == []


@pytest.fixture(scope="module")
def mini(browser, folders):
    """A page that tests share; each sets the state that it needs."""
    page = Page(browser, write_page([folders["mini"]]).path)
    yield page
    page.close()


def decoded(url) -> np.ndarray:
    """Pixels (H, W, 3) of a PNG in a data URL."""
    return cv2.imdecode(np.frombuffer(base64.b64decode(url.split(",")[1]), np.uint8), cv2.IMREAD_COLOR)[..., ::-1]


def run(page, script, argument=None):
    """The value of a function in the page, which sees the page's own names."""
    return page.page.evaluate(f"argument => (0, eval)({script!r})(argument)", argument)


def shown(page, width, **changes) -> np.ndarray:
    """Pixels (height, width, 3) of the display alone with this state."""
    plain = {"mode": "physical", "stereo": "one", "aperture": 0, "focus": 0}
    return decoded(run(page, """([width, changes]) => {
        Object.assign(state, changes);
        const image = snapshot(width), page = document.createElement('canvas');
        [page.width, page.height] = [image.width, image.height];
        page.getContext('2d').putImageData(image, 0, 0);
        return page.toDataURL(); }""", [width, plain | changes]))


def canvas(page, **changes) -> np.ndarray:
    """Pixels (height, width, 3) of the page's canvas with this state."""
    return decoded(run(page, "changes => { Object.assign(state, changes); resize(); "
                             "strip = {from: 0, rows: canvas.height}; draw(); return canvas.toDataURL(); }", changes))


def difference(first, second) -> float:
    return float(np.abs(first.astype(float) - second).mean())


@pytest.mark.parametrize("name", ["mini", "tall", "direct"])
def test_each_lens_shows_what_the_simulated_eye_sees(opened, folders, name):
    profile, panel = read_frame(folders[name]).display, read_png(folders[name] / "eia.png")
    page = opened(name)
    for eye in NINE:
        seen, pixels = eye_view(panel, profile, eye, width=128), shown(page, 128, eye=eye)
        across, down = profile.lenses
        centres = np.ix_(((np.arange(down) + 0.5) * len(pixels) / down).astype(int),
                         ((np.arange(across) + 0.5) * 128 / across).astype(int))
        assert difference(pixels[centres], eye_view(panel, profile, eye, width=0)) <= 2, eye
        if pixels.shape == seen.shape:
            assert difference(pixels, seen) <= 2, eye
        assert seen.std() > 30


def test_without_loss_the_pixels_are_the_images_and_smooth_is_the_view_where_a_camera_stood(opened, folders):
    page, panel = opened("mini", quality=100), read_png(folders["mini"] / "eia.png")
    for eye in NINE:
        np.testing.assert_array_equal(shown(page, 128, eye=eye), eye_view(panel, MINI, eye, width=128))
    field = read_light_field(folders["mini"])
    offset, middles = view_offset(np.arange(8), 8, MINI.camera_spacing_mm), np.s_[1::3, 1::3]
    for row, column in ((0, 0), (2, 5), (7, 3)):
        pixels = shown(page, 48, mode="smooth", eye=(offset[column], -offset[row], MINI.viewing_distance_mm))
        assert np.abs(pixels[middles].astype(int) - field.views[row, column]).max() <= 1
    eye = (offset[5] + MINI.camera_spacing_mm / 2, -offset[2], MINI.viewing_distance_mm)
    mixed, pixels = (field.views[2, 5].astype(float) + field.views[2, 6]) / 2, shown(page, 48, mode="smooth", eye=eye)
    assert np.abs(pixels[middles] - mixed).max() <= 1
    # Between lenses it lies between them: no steps as wide as a lens.
    steps, lenses = (np.abs(np.diff(image.astype(int), axis=1)).max() for image in (pixels, pixels[middles]))
    assert steps < lenses


def square(pixels) -> tuple[float, float]:
    """Mean (column, row) of the near square, which is the only blue."""
    rows, columns = np.nonzero(pixels[..., 2] > 160)
    return float(columns.mean()), float(rows.mean())


@pytest.mark.parametrize("mode", ["smooth", "physical"])
def test_what_is_near_moves_against_the_eye_and_up_is_up(mini, mode):
    far = MINI.viewing_distance_mm
    middle, right, up = (square(shown(mini, 256, mode=mode, eye=eye)) for eye in (
        (1, 1, far), (ZONE * 0.4, 1, far), (1, ZONE * 0.4, far)))
    assert middle[0] < 128 and middle[1] < 96, "the square is left of the middle and above it"
    assert right[0] < middle[0] - 8 and up[1] > middle[1] + 8


def test_a_click_focuses_on_what_is_there_and_an_aperture_blurs_the_rest(mini):
    far, distance = MINI.viewing_distance_mm, "([x, y]) => depthAt(x, y)"
    run(mini, "eye => { state.eye = eye; }", [1, 1, far])
    per_unit = MINI.panel_mm[0] / 1.6
    # The square is seen on the display where its line from the eye crosses it.
    near = run(mini, distance, [-0.1 * per_unit / 0.8 + 6, 0.1 * per_unit / 0.8 - 4])
    wall = run(mini, distance, [0.5 * per_unit, -0.35 * per_unit])
    assert near == pytest.approx(0.2 * far, abs=0.08 * far) and wall == pytest.approx(-0.25 * far, abs=0.12 * far)
    def detail(focus, aperture):
        pixels = shown(mini, 128, mode="smooth", eye=(1, 1, far), focus=focus, aperture=aperture).astype(float)
        return np.abs(np.diff(pixels[40:60, 45:65, 0], axis=1)).mean()  # inside the near square
    assert detail(0.2 * far, 0.5) > 1.5 * detail(-0.25 * far, 0.5)
    assert detail(0.2 * far, 0.5) > 0.8 * detail(0.2 * far, 0)


def state(page) -> dict:
    return run(page, "() => structuredClone(state)")


def test_the_keyboard_alone_does_everything(opened):
    page = opened("mini")
    keys = page.page.keyboard
    assert state(page)["eye"] == [0, 0, MINI.viewing_distance_mm]
    for key in ("ArrowRight", "ArrowRight", "ArrowUp", "+", "m", "s", "]", "a"):
        keys.press(key)
    now = state(page)
    assert now["eye"][0] == pytest.approx(ZONE / 10) and now["eye"][1] == pytest.approx(ZONE / 20)
    assert now["eye"][2] < MINI.viewing_distance_mm and now["focus"] > 0 and now["aperture"] == 0.05
    assert (now["mode"], now["stereo"]) == ("physical", "side")
    keys.press("s")
    assert state(page)["stereo"] == "anaglyph"
    keys.press("0")
    assert state(page)["eye"] == [0, 0, MINI.viewing_distance_mm]
    keys.press("Space")
    page.page.wait_for_function("(0, eval)('state').eye[0] > 1")
    reached = {keys.press("Tab") or page.page.evaluate("document.activeElement.id") for _ in range(14)}
    assert {"mode", "stereo", "aperture", "focus", "sway", "reset", "save", "full"} <= reached
    page.page.focus("#mode")
    keys.press("ArrowDown")
    assert state(page)["mode"] == "physical"


def test_pointer_wheel_and_touch(opened):
    page = opened("mini", has_touch=True)
    mouse = page.page.mouse
    mouse.move(200, 150)
    mouse.down()
    mouse.move(240, 130, steps=4)
    mouse.up()
    x, y, z = state(page)["eye"]
    assert x > 5 and y > 2 and z == MINI.viewing_distance_mm and state(page)["aperture"] == 0
    mouse.wheel(0, -300)
    page.page.wait_for_function(f"(0, eval)('state').eye[2] < {z}")
    page.page.touchscreen.tap(200, 150)
    page.page.wait_for_function("(0, eval)('state').aperture > 0")


def test_stereo_draws_each_eye(mini):
    far, half, plain = MINI.viewing_distance_mm, 20, {"mode": "smooth", "aperture": 0, "focus": 0}
    left, right = (canvas(mini, stereo="one", eye=[x, 0, far], **plain) for x in (-half, half))
    mixed = canvas(mini, stereo="anaglyph", eye=[0, 0, far], eyes=2 * half)
    np.testing.assert_array_equal(mixed[..., 0], left[..., 0])
    np.testing.assert_array_equal(mixed[..., 1:], right[..., 1:])
    assert difference(left, right) > 3
    pair = canvas(mini, stereo="side")
    wide = pair.shape[1] // 2
    # The right eye sees what is near further to the left.
    assert square(pair[:, :wide])[0] > square(pair[:, wide:2 * wide])[0] + 4


def test_sway_respects_reduced_motion_and_a_screen_reader_is_told_only_where_the_eye_rests(opened):
    still, moving = opened("mini"), opened("mini", reduced_motion="no-preference")
    moving.page.wait_for_function("Math.abs((0, eval)('state').eye[0]) > 2")
    assert still.page.get_attribute("#sway", "aria-pressed") == "false"
    assert moving.page.get_attribute("#sway", "aria-pressed") == "true"
    assert state(still)["eye"][0] == 0
    moving.page.evaluate("""() => { window.told = 0; const seen = new MutationObserver(() => { window.told++; });
        for (const part of document.querySelectorAll('[role=status], [role=alert], [aria-live]'))
            seen.observe(part, {childList: true, characterData: true, subtree: true}); }""")
    moving.page.wait_for_timeout(1500)  # it sways
    assert moving.page.evaluate("window.told") <= 1
    moving.page.keyboard.press("ArrowRight")
    moving.page.wait_for_function("document.getElementById('spoken').textContent.startsWith('eye ')")
    assert moving.page.evaluate("window.told") <= 3


def test_a_small_gpu_gets_half_and_says_so_and_a_thinned_row_of_views_all_rows(opened, folders, tmp_path, monkeypatch):
    page = opened("mini", "#texture=100", quality=100)
    assert "64×48 of 128×96" in page.page.inner_text("#note")
    panel = read_png(folders["mini"] / "eia.png").astype(float)
    halved = panel.reshape(48, 2, 64, 2, 3).mean((1, 3)).repeat(2, axis=0).repeat(2, axis=1)
    assert difference(shown(page, 128, eye=NINE[5]), eye_view(halved, MINI, NINE[5], width=128)) <= 2
    monkeypatch.setattr("lfsr_core.exports.page.MOST_SIDE", 64)
    row = dataclasses.replace(MINI, views=(8, 1), panel_pixels=(128, 12))
    panel = read_png(finished(tmp_path, row) / "eia.png")[:, ::2].repeat(2, axis=1)
    pixels = shown(opened(tmp_path, quality=100), 128, eye=NINE[1])
    np.testing.assert_array_equal(pixels, eye_view(panel, row, NINE[1], width=128))


def test_frames_of_an_animation(opened, folders, tmp_path):
    for number in (3, 4):
        finished(tmp_path / "Scene" / f"{number:04d}", frame=number,
                 matrix_world=read_frame(folders["mini"]).matrix_world)
    bright = tmp_path / "Scene" / "0004" / "eia.png"
    write_png(bright, 255 - read_png(bright))
    page = opened(tmp_path / "Scene")
    assert page.page.inner_text("#frameName") == "3"
    first = shown(page, 64)
    page.page.keyboard.press(".")
    page.page.wait_for_function("document.getElementById('frameName').textContent === '4'")
    page.page.wait_for_function("(0, eval)('textures').size === 2")
    assert difference(shown(page, 64), 255 - first) < 4
    page.page.keyboard.press("p")
    page.page.wait_for_function("(0, eval)('state').frame === 0")


def test_says_what_the_display_is_and_asks_nothing_of_the_network(mini):
    text, size = mini.page.inner_text("header"), " × ".join(f"{mm:.0f}" for mm in MINI.panel_mm)
    assert MINI.title in text and f"{size} mm" in text and f"from {MINI.viewing_distance_mm:.0f} mm" in text
    assert all(re.match(r"(file|data|blob):", url) for url in mini.requests) and mini.complaints == []
    assert math.isfinite(float(mini.page.get_attribute("#map circle", "cy")))


def test_the_canvas_shows_the_display_where_the_layout_says(opened, folders):
    eye = NINE[5]
    page = opened("mini", "#mode=physical&eye=" + ",".join(map(str, eye)), viewport={"width": 800, "height": 600})
    place = run(page, "() => ({...layout, bar: find('controls').getBoundingClientRect().top})")
    pixels = cv2.imdecode(np.frombuffer(page.page.screenshot(), np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    seen = eye_view(read_png(folders["mini"] / "eia.png"), MINI, eye, width=0)
    rows, columns = np.indices(seen.shape[:2])
    x = place["x"] + ((columns + 0.5) / 16 - 0.5) * MINI.panel_mm[0] * place["scale"]
    y = place["y"] + ((rows + 0.5) / 12 - 0.5) * MINI.panel_mm[1] * place["scale"]
    inside = (y > 60) & (y < place["bar"]) & (x > 0) & (x < 800) & ~((x > 620) & (y < 180))
    assert inside.mean() > 0.6 and difference(pixels[y[inside].astype(int), x[inside].astype(int)], seen[inside]) <= 2


def test_what_the_address_says_wrongly_is_ignored_with_a_note(opened):
    page = opened("mini", "#eye=NaN")
    for address in ("eye=NaN", "eye=1,2&mode=upside", "eye=1,,3&stereo=3&texture=-5", "eye=0,0,-5&texture=0",
                    "eye=1,2,x&texture=big"):
        if address != "eye=NaN":  # with which it was opened
            run(page, "address => { location.hash = address; readAddress(); }", address)
        said = page.page.inner_text("#note")
        assert all(f"{part} in the address was ignored: expected" in said for part in address.split("&")), address
        assert state(page) == state(page) | {"eye": [0, 0, MINI.viewing_distance_mm], "mode": "smooth", "stereo": "one"}
        assert canvas(page).std() > 30


@pytest.mark.parametrize("sizes", [[(360, 740), (740, 360), (320, 568)], [(1280, 720)]])
def test_the_caption_covers_neither_map_nor_image(opened, sizes):
    """Also on telephones, which are turned."""
    sizes = [{"width": width, "height": height} for width, height in sizes]
    page = opened("mini", viewport=sizes[0], device_scale_factor=2, is_mobile=len(sizes) > 1, has_touch=True)
    for size in sizes:
        page.page.set_viewport_size(size)
        page.page.wait_for_function("({width}) => (0, eval)('layout.x * 2 / layout.ratio') === width", arg=size)
        header, plan = (page.page.locator(name).bounding_box() for name in ("header", "#map"))
        assert header["x"] + header["width"] <= min(plan["x"], size["width"]) and header["x"] >= 0
        top = run(page, "() => (layout.y - display.panel_mm[1] / 2 * layout.scale) / layout.ratio")
        assert header["y"] + header["height"] <= top
        assert page.page.evaluate("document.querySelector('header').scrollWidth") <= header["width"] + 1


def test_an_aperture_is_drawn_with_fewer_samples_while_it_changes(opened):
    """48 samples of each pixel take as many times as long; at rest they are all drawn."""
    page, work = opened("mini"), "() => canvas.width * canvas.height * pupilSamples()"
    sharp, size = run(page, work), run(page, "() => canvas.width")
    # Until a frame comes soon enough after a change, which a busy machine may delay.
    run(page, """() => new Promise(done => {
        const area = () => canvas.width * canvas.height, change = () => {
          find('aperture').value = 0.5;
          find('aperture').dispatchEvent(new Event('input'));
          requestAnimationFrame(() => quick ? done(window.hurried = area() * pupilSamples()) : change());
        };
        change();
      })""")
    assert page.page.evaluate("window.hurried") <= 3 * sharp
    page.page.wait_for_function("!(0, eval)('quick')")
    assert run(page, work) == 48 * sharp and run(page, "() => canvas.width") == size


def test_the_image_at_rest_is_drawn_in_strips_over_the_quick_one(opened):
    """Strips join to the image that is drawn at once, and the page never shows less than the quick one."""
    page = opened("mini", viewport={"width": 400, "height": 300})
    whole = canvas(page, aperture=0.5, focus=20)
    heights = run(page, """() => new Promise(done => {
        const heights = [], before = drawStrip, least = [];
        drawStrip = () => { heights.push(strip.rows); before(); };
        find('aperture').dispatchEvent(new Event('input'));
        const look = () => {
          const pixel = new Uint8Array(4);
          gl.readPixels(canvas.width / 2, canvas.height / 2, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
          if (!dirty) least.push(Math.max(...pixel.subarray(0, 3)));
          const isDone = !quick && strip.from >= canvas.height && performance.now() - changed > SETTLED;
          isDone ? done({heights, least: Math.min(...least)}) : requestAnimationFrame(look);
        };
        find('aperture').value = 0.5;
        find('aperture').dispatchEvent(new Event('input'));
        look();
      })""")
    assert len(heights["heights"]) > 3 and 8 in heights["heights"] and heights["least"] > 0
    at_rest = decoded(run(page, "() => canvas.toDataURL()"))
    assert at_rest.shape == whole.shape and difference(at_rest, whole) < 0.05


def test_a_slow_machine_sways_at_a_quarter_of_the_pixels_or_not_at_all(opened):
    page = opened("mini")
    before = run(page, "() => { setSway(true); return canvas.width; }")
    # As if each image took so long: the paces are what was measured of the last images.
    run(page, "() => { paces = Array(PACED).fill(FLUENT + 1); }")
    page.page.wait_for_function("(0, eval)('slow && quick')")
    assert run(page, "() => canvas.width") < before and state(page)["eye"] != [0, 0, MINI.viewing_distance_mm]
    run(page, "() => { paces = Array(PACED).fill(STILL + 1); }")
    page.page.wait_for_function("!(0, eval)('swaying')")
    assert "stands still" in page.page.inner_text("#note")


def drawn_at_display(page) -> np.ndarray:
    """What a picture of the page's window shows where the display is, 16 × 12 pixels."""
    encoded = np.frombuffer(page.screenshot(), np.uint8)
    box = page.locator("#still").bounding_box()
    x, y, width, height = (round(box[name]) for name in ("x", "y", "width", "height"))
    pixels = cv2.imdecode(encoded, cv2.IMREAD_COLOR)[y:y + height, x:x + width, ::-1]
    return cv2.resize(pixels, (16, 12), interpolation=cv2.INTER_AREA)


def test_without_webgl_it_shows_a_still_image_and_says_so(browser, folders):
    plain = browser.browser_type.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-3d-apis"])
    page = Page(plain, write_page([folders["mini"]]).path)
    assert "a still image from the middle" in page.page.inner_text("#note")
    assert not page.page.locator("#controls").is_visible()
    assert difference(drawn_at_display(page.page), read_light_field(folders["mini"]).views[3, 3]) < 15
    assert page.complaints == []
    plain.close()


def test_a_still_image_is_there_until_the_large_one_is(browser, folders):
    path = write_page([folders["mini"]]).path
    context = browser.new_context(viewport={"width": 480, "height": 400}, reduced_motion="reduce")
    page = context.new_page()
    page.add_init_script("const real = createImageBitmap, gate = new Promise(done => { window.go = done; });"
                         "window.createImageBitmap = (...all) => gate.then(() => real(...all));")
    page.goto(path.resolve().as_uri())
    page.wait_for_function("document.getElementById('size').textContent")
    assert difference(drawn_at_display(page), read_light_field(folders["mini"]).views[3, 3]) < 15
    place = page.locator("#still").bounding_box()
    page.evaluate("window.go()")
    page.wait_for_selector("html[data-ready=true]")
    page.wait_for_function("document.getElementById('still').hidden")
    layout = page.evaluate("(0, eval)('({...layout})')")
    assert place["x"] + place["width"] / 2 == pytest.approx(layout["x"] / layout["ratio"], abs=1)
    assert place["width"] == pytest.approx(MINI.panel_mm[0] * layout["scale"] / layout["ratio"], abs=1)
    context.close()


def test_changed_geometry_is_in_the_page(tmp_path):
    far = dataclasses.replace(MINI, title="</script>far", viewing_distance_mm=500.0)
    text = write_page([finished(tmp_path / "far", far)]).path.read_text(encoding="utf-8")
    assert '"distance_mm": 500.0' in text and "\\u003c/script>far" in text
    assert text.count("</script>") == text.count("<script")


# The page that shows a panel's image full screen.
SIZE = 600, 300  # divisible by every scaling below


@pytest.fixture
def screen(browser, tmp_path):
    """Open the page in a window that fills a screen of ``size`` pixels, or ``whole`` ones, at a ``scaling``; and its
    images."""
    pages = []

    def opening(size=SIZE, scaling=1.0, whole=None, count=1, seconds=1.0):
        random, images = np.random.default_rng(0), [tmp_path / f"panel <b>é #{number}%.png" for number in range(count)]
        for image in images:
            write_png(image, random.integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8))
        write_screen_page(tmp_path / "show.html", images, seconds)
        window, whole = ({"width": round(width / scaling), "height": round(height / scaling)}
                         for width, height in (size, whole or size))
        pages.append(Page(browser, tmp_path / "show.html", viewport=window, screen=whole, device_scale_factor=scaling))
        return pages[-1], images
    yield opening
    for page in pages:
        page.close()


def seen(page):
    return cv2.imdecode(np.frombuffer(page.page.screenshot(), np.uint8), cv2.IMREAD_COLOR)[..., ::-1]


def note(page):
    return page.page.inner_text("p") if page.page.is_visible("p") else ""


@pytest.mark.parametrize("scaling", [1.25, 2.0, *(pytest.param(zoom, marks=pytest.mark.long) for zoom in (1, 1.5, 3))])
def test_each_pixel_of_the_image_is_one_of_the_screen(screen, tmp_path, scaling):
    page, (image,) = screen(scaling=scaling)
    assert note(page) == "" and not page.complaints
    assert (seen(page) == read_png(image)).all() and all(url.startswith(("file:", "data:")) for url in page.requests)


@pytest.mark.parametrize(("size", "scaling"), [((600, 250), 1.0), ((400, 300), 1.0), ((1200, 600), 2.0),
                                               ((603, 300), 1.0)])
def test_a_screen_of_another_size_is_said(screen, tmp_path, size, scaling):
    page, _ = screen(size, scaling)
    assert note(page).startswith(f"This screen has {size[0]} × {size[1]} pixels, but the image has 600 × 300")


def test_a_click_makes_it_full_screen(screen, tmp_path):
    page, _ = screen((450, 250), whole=SIZE)
    assert note(page).startswith("Move this window to the display and click here")
    page.page.mouse.click(225, 125)
    page.page.wait_for_function("document.querySelector('p').textContent.startsWith('This screen')")
    page.page.evaluate("document.exitFullscreen()")
    page.page.wait_for_function("document.querySelector('p').textContent.startsWith('Move')")
    page.page.keyboard.press("f")
    page.page.wait_for_function("Boolean(document.fullscreenElement)")
    page.page.set_viewport_size({"width": 600, "height": 300})  # a window manager's part
    page.page.wait_for_function("document.querySelector('p').textContent === ''")
    assert page.page.evaluate("getComputedStyle(document.body).cursor") == "none"


# The page decodes the next image as soon as it shows one: notes which it shows, and lets the film stand still at last.
IN_TURN = """new Promise(done => {
    const order = [], decode = HTMLImageElement.prototype.decode;
    HTMLImageElement.prototype.decode = function () {
        order.push(document.querySelector("img:not([hidden])").src);
        return order.length < 7 ? decode.call(this) : (done(order), new Promise(() => {}));
    };
})"""


def test_an_animation_shows_its_images_in_turn_and_one_that_is_gone_is_said(screen, tmp_path):
    page, images = screen(count=3, seconds=0.2)
    order = [[image.as_uri() for image in images].index(source) for source in page.page.evaluate(IN_TURN)]
    assert [(later - earlier) % 3 for earlier, later in itertools.pairwise(order)] == [1] * 6
    assert (seen(page) == read_png(images[order[-1]])).all(), "the film stands still at the last of them"
    page, (image,) = screen()
    image.unlink()
    page.page.goto("about:blank")
    page.page.goto((tmp_path / "show.html").as_uri())
    page.page.wait_for_function("document.querySelector('p').textContent.startsWith('An image of this page is gone')")
