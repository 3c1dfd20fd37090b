"""A page that shows a panel's own image full screen in any browser, a pixel of the image on each of the display's.

It reads the images where they lie and fetches nothing else. In full screen it compares its size in the display's pixels
with the image's, and says what is wrong where they differ.
"""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from pathlib import Path

from lfsr_core.base.files import atomic_path

TEMPLATE = Path(__file__).with_name("screen.html")


def write_screen_page(path: Path, images: Sequence[Path], seconds: float) -> None:
    """Write the page of an image, or of several that follow each other after ``seconds``, over and over."""
    data = json.dumps({"images": [image.resolve().as_uri() for image in images], "seconds": seconds})
    text = TEMPLATE.read_text(encoding="utf-8")
    text = text.replace("TITLE", html.escape(images[0].parent.name), 1).replace("DATA", data.replace("<", "\\u003c"), 1)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
