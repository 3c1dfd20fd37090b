"""The page that shows a panel's image full screen, in a real browser."""

import itertools

import cv2
import numpy as np
import pytest

from lfsr_core.exports.show import write_screen_page
from lfsr_core.images.png import read_png, write_png
from tests.support.browser import Page, chromium, needs_chromium

pytestmark = needs_chromium
SIZE = 600, 300  # divisible by every scaling below


@pytest.fixture(scope="module")
def browser():
    with chromium() as running:
        yield running


@pytest.fixture
def opened(browser, tmp_path):
    """Open the page in a window that fills a screen of ``size`` pixels at a system's ``scaling``; it and its images.

    ``screen``: pixels of the screen where the window is smaller.
    """
    pages = []

    def opening(size=SIZE, scaling=1.0, screen=None, count=1, seconds=1.0):
        random, images = np.random.default_rng(0), [tmp_path / f"panel <b>é #{number}%.png" for number in range(count)]
        for image in images:
            write_png(image, random.integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8))
        write_screen_page(tmp_path / "show.html", images, seconds)
        window, whole = ({"width": round(width / scaling), "height": round(height / scaling)}
                         for width, height in (size, screen or size))
        pages.append(Page(browser, tmp_path / "show.html", viewport=window, screen=whole, device_scale_factor=scaling))
        return pages[-1], images
    yield opening
    for page in pages:
        page.close()


def seen(page):
    return cv2.imdecode(np.frombuffer(page.page.screenshot(), np.uint8), cv2.IMREAD_COLOR)[..., ::-1]


def note(page):
    return page.page.inner_text("p") if page.page.is_visible("p") else ""


@pytest.mark.parametrize("scaling", [1.0, 1.25, 1.5, 2.0, 3.0])
def test_each_pixel_of_the_image_is_one_of_the_screen(opened, tmp_path, scaling):
    page, (image,) = opened(scaling=scaling)
    assert note(page) == "" and not page.complaints
    assert (seen(page) == read_png(image)).all()
    assert all(url.startswith(("file:", "data:")) for url in page.requests)


@pytest.mark.parametrize(("size", "scaling"), [((600, 250), 1.0), ((400, 300), 1.0), ((1200, 600), 2.0),
                                               ((603, 300), 1.0)])
def test_a_screen_of_another_size_is_said(opened, tmp_path, size, scaling):
    page, _ = opened(size, scaling)
    assert note(page).startswith(f"This screen has {size[0]} × {size[1]} pixels, but the image has 600 × 300")


def test_a_click_makes_it_full_screen(opened, tmp_path):
    page, _ = opened((450, 250), screen=SIZE)
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


def test_an_animation_shows_its_images_in_turn(opened, tmp_path):
    page, images = opened(count=3, seconds=0.2)
    order = [[image.as_uri() for image in images].index(source) for source in page.page.evaluate(IN_TURN)]
    assert [(later - earlier) % 3 for earlier, later in itertools.pairwise(order)] == [1] * 6
    assert (seen(page) == read_png(images[order[-1]])).all(), "the film stands still at the last of them"


def test_an_image_that_is_gone_is_said(opened, tmp_path):
    page, (image,) = opened()
    image.unlink()
    page.page.goto("about:blank")
    page.page.goto((tmp_path / "show.html").as_uri())
    page.page.wait_for_function("document.querySelector('p').textContent.startsWith('An image of this page is gone')")
