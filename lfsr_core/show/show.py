"""What is shown where: quilts through Looking Glass Bridge, a panel's own image full screen in a browser."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

from lfsr_core.errors import LfsrError
from lfsr_core.exports.formats import export
from lfsr_core.exports.frame_folders import frame_folders
from lfsr_core.exports.options import ExportOptions
from lfsr_core.frames.frame import EIA_FILE, PANEL_FILE, Frame, read_rendered
from lfsr_core.progress import Progress, silent
from lfsr_core.show.bridge import Bridge, Device, Quilt, chosen
from lfsr_core.show.screen import write_screen_page

SCREEN = "screen"  # instead of a display's name: full screen, without Bridge
PAGE = "show.html"
QUILT = re.compile(r"_qs([1-9]\d{0,2})x([1-9]\d{0,2})a(\d{0,3}\.?\d{1,9})$")
FILMS = (".mp4", ".webm", ".mov", ".avi")


@dataclasses.dataclass(frozen=True)
class Shown:
    """What is shown."""

    sentence: str  # where it is, or what is still to be done
    page: Path | None = None  # that is still to be opened in a browser


def show(path: str | Path, display: str | None = None, fps: float = 24.0, progress: Progress = silent) -> Shown:
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
    path, options = Path(path), ExportOptions(fps=fps, progress=progress)
    if not path.is_dir():
        return _show_file(path, display)
    frames = frame_folders(path, (EIA_FILE, PANEL_FILE))
    first = read_rendered(frames[0])
    wants_quilt = display != SCREEN if display else first.display.lenticular is not None
    if not wants_quilt or not (frames[0] / EIA_FILE).is_file():
        if display not in (None, SCREEN):
            raise LfsrError(f"{path} holds the panel's image alone, but display {display!r} of Looking Glass Bridge "
                            f"needs views: give --display {SCREEN}")
        return _full_screen(path / PAGE, [_panel_image(folder, first) for folder in frames], 1 / fps)
    bridge = Bridge()
    device = chosen(bridge.devices(), display, first.display.panel_mm[0] / first.display.panel_mm[1])
    if len(frames) > 1:
        (quilt,) = export(path, "quilt-film", options=options).files
    else:
        (quilt,) = export(frames[0], "quilt", options=dataclasses.replace(options, fps=None)).files
    return _play(bridge, quilt, device)


def _show_file(path: Path, display: str | None) -> Shown:
    if not path.is_file():
        raise LfsrError(f"{path} does not exist, expected a frame folder, a quilt or another image: check the path")
    if QUILT.search(path.stem) and display != SCREEN:
        bridge = Bridge()
        return _play(bridge, path, chosen(bridge.devices(), display))
    if display not in (None, SCREEN) or path.suffix.lower() in FILMS:
        raise LfsrError(f"{path.name} is no quilt by its name, expected an ending as in name_qs8x6a0.75.png: rename it "
                        f"if it is one, or show the panel's image with --display {SCREEN}")
    return _full_screen(path.with_name(f"{path.stem}.{PAGE}"), [path], 1.0)


def _play(bridge: Bridge, path: Path, device: Device) -> Shown:
    found = QUILT.search(path.stem)
    assert found
    columns, rows, aspect = found.groups()
    bridge.play(Quilt(path, (int(columns), int(rows)), float(aspect)), device)
    return Shown(f"{path.name} is shown on {device.name} ({device.hardware})")


def _panel_image(folder: Path, frame: Frame) -> Path:
    path = folder / (PANEL_FILE if frame.display.is_woven else EIA_FILE)
    if not path.is_file():
        raise LfsrError(f"{folder} holds no {path.name}, the panel's image: finish it with `lfsr upscale`")
    return path


def _full_screen(page: Path, images: list[Path], seconds: float) -> Shown:
    write_screen_page(page, images, seconds)
    return Shown("The browser shows it full screen: move its window to the display and click into it", page)
