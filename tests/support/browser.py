"""A real headless Chromium for tests of pages."""

import importlib.util
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
PLAYWRIGHT = importlib.util.find_spec("playwright") is not None
needs_chromium = pytest.mark.skipif(not (CHROMIUM and PLAYWRIGHT) and not os.environ.get("CI"),
                                    reason="needs Debian's package chromium and the package playwright")
# No sandbox: tests may run as root. SwiftShader is WebGL without a GPU.
FLAGS = ["--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


@contextmanager
def chromium() -> Iterator[object]:
    """A running browser (playwright.sync_api.Browser)."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        try:
            yield browser
        finally:
            browser.close()


class Page:
    """One open page; what it complains of in its console, and what it asks the network for, is kept."""

    def __init__(self, browser: object, path: Path, options: str = "", **context: object) -> None:
        self._context = browser.new_context(**{"viewport": {"width": 480, "height": 400},
                                               "reduced_motion": "reduce"} | context)
        self.page = self._context.new_page()
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda message: self._keep(f"{message.type}: {message.text}"))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(f"{path.resolve().as_uri()}{options}")
        self.page.wait_for_selector("html[data-ready=true]")

    def _keep(self, complaint: str) -> None:
        # A slow machine's driver remarks on its own speed; the page can do nothing about that.
        if "GL Driver Message (OpenGL, Performance" not in complaint:
            self.complaints.append(complaint)

    def close(self) -> None:
        self._context.close()
