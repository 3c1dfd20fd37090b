"""What is shown where: quilts through Looking Glass Bridge, a panel's own image full screen in a browser."""

from __future__ import annotations

import dataclasses
import html
import json
from collections.abc import Sequence
from pathlib import Path

from lfsr_core.base.errors import LfsrError
from lfsr_core.base.files import atomic_path, cache_folder
from lfsr_core.base.notices import Tell, silent
from lfsr_core.exports.bridge import Bridge, Device, Quilt, chosen
from lfsr_core.exports.formats import export
from lfsr_core.exports.options import ExportOptions, read_quilt_name
from lfsr_core.frames.folder import frame_folders
from lfsr_core.frames.frame import EIA_FILE, PANEL_FILE, read_rendered
from lfsr_core.images.source import opened

SCREEN = "screen"  # instead of a display's name: full screen, without Bridge
PAGE, TEMPLATE = "show.html", Path(__file__).with_name("screen.html")
FILMS = (".mp4", ".webm", ".mov", ".avi")


@dataclasses.dataclass(frozen=True)
class Shown:
    """What is shown."""

    sentence: str  # where it is, or what is still to be done
    page: Path | None = None  # that is still to be opened in a browser


def show(path: str | Path, display: str | None = None, fps: float = 24.0, tell: Tell = silent) -> Shown:
    """Show a finished frame, an animation, a quilt or a panel's own image.

    Quilts, and frames for lenticular displays that have views, go through Bridge; other images get a page.

    Parameters
    ----------
    path : frame folder, folder of frame folders, quilt or film of quilts by its name, or another image for the panel
    display : index or name of one of Bridge's displays, or SCREEN; None: the first that has the image's proportions
    fps : frames a second of an animation

    Raises
    ------
    LfsrError : without an image, without Bridge, without a display that it is for
    """
    path, options = Path(path), ExportOptions(fps=fps, tell=tell)
    if not path.is_dir():
        return _show_file(path, display)
    frames = frame_folders(path, (EIA_FILE, PANEL_FILE))
    found = find_display(frames[0], display)
    if found is None:
        images = [folder / (PANEL_FILE if read_rendered(folder).display.is_woven else EIA_FILE) for folder in frames]
        for image in images:
            if not image.is_file():
                raise LfsrError(f"{image.parent} holds no {image.name}, the panel's image: finish it with `lfsr "
                                "upscale`")
        return _full_screen(path / PAGE, images, 1 / fps)
    options = dataclasses.replace(options, shape=found[1].shape)  # the device knows its quilt best
    if len(frames) > 1:
        (quilt,) = export(path, "quilt-film", options=options)
    else:
        (quilt,) = export(frames[0], "quilt", options=dataclasses.replace(options, fps=None))
    return _play(quilt, *found)


def find_display(folder: Path, display: str | None = None) -> tuple[Bridge, Device] | None:
    """Session with Bridge and its display for a frame; None where the panel's own image is shown full screen instead.

    ``display`` and errors as of ``show``.
    """
    profile, has_views = read_rendered(folder).display, (folder / EIA_FILE).is_file()
    asked = display not in (None, SCREEN)
    if asked and not has_views:
        raise LfsrError(f"{folder} holds the panel's image alone, but display {display!r} of Looking Glass Bridge "
                        f"needs views: choose display {SCREEN}")
    if not asked and (display == SCREEN or not has_views or profile.lenticular is None):
        return None
    bridge = Bridge()
    return bridge, chosen(bridge.devices(), display, profile.panel_mm[0] / profile.panel_mm[1])


def _show_file(path: Path, display: str | None) -> Shown:
    if not path.is_file():
        raise LfsrError(f"{path} does not exist, expected a frame folder, a quilt or another image: check the path")
    if _quilt(path) and display != SCREEN:
        bridge = Bridge()
        return _play(path, bridge, chosen(bridge.devices(), display))
    if display not in (None, SCREEN) or path.suffix.lower() in FILMS:
        raise LfsrError(f"{path.name} is no quilt by its name, expected an ending as in name_qs8x6a0.75.png: rename it "
                        f"if it is one, or show the panel's image on display {SCREEN}")
    with opened(path) as image:
        if image is None:
            raise LfsrError(f"{path} holds no image, expected a frame folder, a quilt or another image: check the path")
    # The page of somebody else's file lies in our own folder, not beside it.
    page = cache_folder() / PAGE
    page.parent.mkdir(parents=True, exist_ok=True)
    return _full_screen(page, [path], 1.0)


def _quilt(path: Path) -> Quilt | None:
    """The quilt in a file, by its name; None where that names none."""
    grid, aspect = read_quilt_name(path.stem) or ((0, 0), None)
    return Quilt(path, grid, aspect) if min(grid) > 0 else None


def _play(path: Path, bridge: Bridge, device: Device) -> Shown:
    quilt = _quilt(path)
    assert quilt
    bridge.play(quilt, device)
    return Shown(f"{path.name} is shown on {device.name} ({device.hardware})")


def _full_screen(page: Path, images: list[Path], seconds: float) -> Shown:
    write_screen_page(page, images, seconds)
    return Shown("The browser shows it full screen: move its window to the display and click into it", page)


def write_screen_page(path: Path, images: Sequence[Path], seconds: float) -> None:
    """Write the page of an image, or of several that follow each other after ``seconds``, over and over.

    It reads the images where they lie and fetches nothing else. In full screen it compares its size in the display's
    pixels with the image's, and says what is wrong where they differ.
    """
    data = json.dumps({"images": [image.resolve().as_uri() for image in images], "seconds": seconds})
    text = TEMPLATE.read_text(encoding="utf-8")
    text = text.replace("TITLE", html.escape(images[0].parent.name), 1).replace("DATA", data.replace("<", "\\u003c"), 1)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
