"""The page that shows a panel's image full screen, in a real browser."""

import itertools

import cv2
import numpy as np
import pytest

from lfsr_core.exports.show import write_screen_page
from lfsr_core.images.png import read_png, write_png
from tests.support.browser import Page, chromium, needs_chromium

pytestmark = needs_chromium
SIZE = 1200, 600  # divisible by every scaling below


@pytest.fixture(scope="module")
def browser():
    with chromium() as running:
        yield running


def opened(browser, folder, size=SIZE, scaling=1.0, screen=None, count=1, seconds=1.0):
    """Page in a window that fills a screen of ``size`` pixels at a system's ``scaling``; its images.

    ``screen``: pixels of the screen where the window is smaller.
    """
    random, images = np.random.default_rng(0), []
    for number in range(count):
        images.append(folder / f"panel <b>é #{number}%.png")
        write_png(images[-1], random.integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8))
    write_screen_page(folder / "show.html", images, seconds)
    window, whole = ({"width": round(width / scaling), "height": round(height / scaling)}
                     for width, height in (size, screen or size))
    return Page(browser, folder / "show.html", viewport=window, screen=whole, device_scale_factor=scaling), images


def seen(page):
    return cv2.imdecode(np.frombuffer(page.page.screenshot(), np.uint8), cv2.IMREAD_COLOR)[..., ::-1]


def note(page):
    return page.page.inner_text("p") if page.page.is_visible("p") else ""


@pytest.mark.parametrize("scaling", [1.0, 1.25, 1.5, 2.0, 3.0])
def test_each_pixel_of_the_image_is_one_of_the_screen(browser, tmp_path, scaling):
    page, (image,) = opened(browser, tmp_path, scaling=scaling)
    assert note(page) == "" and not page.complaints
    assert (seen(page) == read_png(image)).all()
    assert all(url.startswith(("file:", "data:")) for url in page.requests)
    page.close()


@pytest.mark.parametrize(("size", "scaling"), [((1200, 500), 1.0), ((800, 600), 1.0), ((2400, 1200), 2.0),
                                               ((1203, 600), 1.0)])
def test_a_screen_of_another_size_is_said(browser, tmp_path, size, scaling):
    page, _ = opened(browser, tmp_path, size, scaling)
    assert note(page).startswith(f"This screen has {size[0]} × {size[1]} pixels, but the image has 1200 × 600")
    page.close()


def test_a_click_makes_it_full_screen(browser, tmp_path):
    page, _ = opened(browser, tmp_path, (900, 500), screen=SIZE)
    assert note(page).startswith("Move this window to the display and click here")
    page.page.mouse.click(450, 250)
    page.page.wait_for_function("document.querySelector('p').textContent.startsWith('This screen')")
    page.page.evaluate("document.exitFullscreen()")
    page.page.wait_for_function("document.querySelector('p').textContent.startsWith('Move')")
    page.page.keyboard.press("f")
    page.page.wait_for_function("Boolean(document.fullscreenElement)")
    page.page.set_viewport_size({"width": 1200, "height": 600})  # a window manager's part
    page.page.wait_for_function("document.querySelector('p').textContent === ''")
    assert page.page.evaluate("getComputedStyle(document.body).cursor") == "none"
    page.close()


IN_TURN = """new Promise(done => {
    const order = [];
    (function look() {
        const source = document.querySelector("img:not([hidden])").src;
        if (order.at(-1) !== source) order.push(source);
        order.length < 7 ? requestAnimationFrame(look) : done(order);
    })();
})"""


def test_an_animation_shows_its_images_in_turn(browser, tmp_path):
    page, images = opened(browser, tmp_path, count=3, seconds=0.2)
    order = [[image.as_uri() for image in images].index(source) for source in page.page.evaluate(IN_TURN)]
    assert [(later - earlier) % 3 for earlier, later in itertools.pairwise(order)] == [1] * 6
    picture = seen(page)   # once: while it is compared, the film goes on
    assert any((picture == read_png(image)).all() for image in images)
    page.close()


def test_an_image_that_is_gone_is_said(browser, tmp_path):
    page, (image,) = opened(browser, tmp_path)
    image.unlink()
    page.page.goto("about:blank")
    page.page.goto((tmp_path / "show.html").as_uri())
    page.page.wait_for_function("document.querySelector('p').textContent.startsWith('An image of this page is gone')")
    page.close()
