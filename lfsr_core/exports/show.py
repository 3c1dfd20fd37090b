"""Show images on displays: quilts through Looking Glass Bridge, a panel's own image full screen in a browser."""

import dataclasses
import html
import json
import re
import secrets
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from lfsr_core.base.messages import LfsrError, Tell, silent
from lfsr_core.base.system import atomic_path, cache_folder, parse_json
from lfsr_core.calibration.makers import Calibration, calibration_of
from lfsr_core.exports import loopback
from lfsr_core.exports.formats import export
from lfsr_core.exports.loopback import PROGRAM
from lfsr_core.exports.options import ExportOptions, read_quilt_name
from lfsr_core.frames.folder import frame_folders
from lfsr_core.frames.frame import EIA_FILE, PANEL_FILE, read_rendered
from lfsr_core.images.image_files import opened

SCREEN = "screen"  # instead of a display's name: full screen, without Bridge
PAGE, TEMPLATE = "show.html", Path(__file__).with_name("screen.html")
FILMS = (".mp4", ".webm", ".mov", ".avi")
Call = Callable[[str, dict[str, Any]], Any]
DONE = ("Completion", "Pending")
MONITOR = "thirdparty"  # hardware of a display without lenses
STILL_MS = 20_000  # the playlist of one image begins again then
MOST_SIDE = 16384  # pixels of a quilt
SAME_ASPECT = 0.02  # within which two proportions are the same


@dataclasses.dataclass(frozen=True)
class Device:
    """A display that Bridge reports; only those with lenses are kept."""

    index: int  # its "head"
    name: str  # hwid
    hardware: str  # hardwareVersion, as "portrait"
    corner: tuple[int, int]  # windowCoords: of the upper left corner, in pixels of the desktop
    quilt: Mapping[str, Any]  # defaultQuilt: quiltX, quiltY, tileX, tileY, quiltAspect, as far as they are stated
    data: Any  # calibration, as JSON data

    @property
    def shape(self) -> tuple[int, int, int, int] | None:
        """Its quilt as of ``DisplayProfile.quilt``; None where Bridge does not state a possible one."""
        stated = [self.quilt.get(name) for name in ("tileX", "tileY", "quiltX", "quiltY")]
        numbers = [int(number) for number in stated if isinstance(number, (int, float)) and 1 <= number <= MOST_SIDE]
        if len(numbers) < len(stated):
            return None
        columns, rows, width, height = numbers
        return (columns, rows, width // columns, height // rows) if width >= columns and height >= rows else None

    @property
    def calibration(self) -> Calibration:
        """Calibration of this unit; LfsrError if Bridge has none or a wrong one."""
        return calibration_of(self.data, f"the calibration of display {self.name!r} in Bridge")


class Bridge:
    """A session with Bridge, the maker's program; LfsrError if it does not run.

    Every call but the first carries the token of a session, the orchestration. Bridge answers an unknown endpoint with
    an empty reply, so each reply must state a status. Bridge keeps a playlist until Bridge ends: a second one of the
    same name would show the first one's quilt, and ``delete_playlist`` has hung Bridge 2.6.3. So each image gets a
    playlist of a new name, which is filled while the last one is still shown, and then played without a gap.
    """

    def __init__(self, call: Call = loopback.put) -> None:
        self._call = call
        token = _within(call("enter_orchestration", {"name": "default"}), "payload")
        if not isinstance(token, str) or not token:
            raise LfsrError(f"{PROGRAM} opened no session: update it to version 2.2 or newer")
        self._session = {"orchestration": token}

    def devices(self) -> list[Device]:
        """Displays with lenses, by index; LfsrError if there is none."""
        entries, devices = _within(self._put("available_output_devices"), "payload"), []
        for entry in entries.values() if isinstance(entries, dict) else ():
            index, corner, quilt = (_within(entry, name) for name in ("index", "windowCoords", "defaultQuilt"))
            corner, quilt = corner if isinstance(corner, dict) else {}, _parsed(quilt)
            device = Device(index if isinstance(index, int) else -1, str(_within(entry, "hwid") or ""),
                            str(_within(entry, "hardwareVersion") or ""), (corner.get("x", 0), corner.get("y", 0)),
                            quilt if isinstance(quilt, dict) else {}, _parsed(_within(entry, "calibration")))
            if device.hardware.lower() != MONITOR:
                devices.append(device)
        if not devices:
            raise LfsrError(f"{PROGRAM} sees no Looking Glass: connect the display and switch it on, or end {PROGRAM} "
                            "and start it again")
        return sorted(devices, key=lambda device: device.index)

    def play(self, path: Path, device: Device) -> None:
        """Replace the shown image by a quilt, or by a film of quilts that repeats; the file's name states the tiles."""
        name, said = f"lfsr-{secrets.token_hex(8)}", read_quilt_name(path.stem)
        assert said is not None, "of what is played"
        self._put("instance_playlist", name=name, loop=True)
        columns, rows = said.grid
        self._put("insert_playlist_entry", name=name, id=0, index=0, uri=str(path.resolve()), rows=rows,
                  cols=columns, aspect=said.aspect or _aspect(device, 1.0), view_count=columns * rows, isRGBD=0,
                  focus=0, zoom=1, crop_pos_x=0, crop_pos_y=0, tag="", durationMS=STILL_MS)
        self._put("show_window", show_window=True, head_index=device.index)
        self._put("play_playlist", name=name, head_index=device.index)

    def _put(self, endpoint: str, **body: Any) -> Any:
        """Answer to a call of this session; LfsrError unless it says that it is done."""
        answer = self._call(endpoint, self._session | body)
        if (status := _within(answer, "status")) is None:
            raise LfsrError(f"{PROGRAM} answers {endpoint} with nothing: update it to version 2.2 or newer")
        if status not in DONE:
            message = _within(answer, "payload", "message")
            raise LfsrError(f"{PROGRAM} refuses {endpoint} ({status}{f': {message}' if message else ''}): end other "
                            "programs that use the display, or start it again")
        return answer


def chosen(devices: Sequence[Device], wanted: str | None, aspect: float | None = None) -> Device:
    """Return the display of an index or name, by default the first with the image's ``aspect`` (width / height).

    LfsrError if there is none, or if the wanted display has another aspect.
    """
    named = [device for device in devices if wanted is None or wanted.lower() in (str(device.index),
                                                                                   device.name.lower())]
    names = ", ".join(f"{device.index} ({device.name})" for device in devices)
    if wanted is not None and len(named) > 1:
        named = [device for device in named if wanted == str(device.index)]
        if len(named) != 1:
            raise LfsrError(f"{PROGRAM} has several displays called {wanted!r}: choose one of {names} by its number")
    if not named:
        raise LfsrError(f"display {wanted!r} is not among those of {PROGRAM}: choose one of {names}")
    fitting = [device for device in named if aspect is None or abs(_aspect(device, aspect) / aspect - 1) <= SAME_ASPECT]
    if not fitting:
        raise LfsrError(f"the image is made for a panel of width / height {aspect:.3f}, but display {named[0].name!r} "
                        f"has {_aspect(named[0], 0):.3f}: render it with that display's own profile")
    return fitting[0]


def _aspect(device: Device, unknown: float) -> float:
    """Width / height of the panel; ``unknown`` where Bridge does not tell."""
    try:
        numbers = device.calibration.numbers
    except LfsrError:
        return unknown
    return numbers["screenW"] / numbers["screenH"]


def _within(data: Any, *names: str) -> Any:
    """Value of a nested field, None where it is missing: Bridge wraps each in an object with the key "value"."""
    for name in names:
        data = data.get("value", data) if isinstance(data, dict) else None
        data = data.get(name) if isinstance(data, dict) else None
    return data.get("value") if isinstance(data, dict) else data


def _parsed(text: Any) -> Any:
    """Data of JSON text, as Bridge writes calibrations; None where it is none."""
    try:
        return parse_json(text.encode()) if isinstance(text, str) else text
    except ValueError:
        return None


@dataclasses.dataclass(frozen=True)
class Shown:
    """What is shown."""

    sentence: str  # where it is, or what is still to be done
    page: Path | None = None  # that is still to be opened in a browser


def show(path: str | Path, display: str | None = None, fps: float = 24.0, tell: Tell = silent) -> Shown:
    """Show a finished frame, an animation, a quilt or a panel's own image.

    Quilts, and frames for lenticular displays that have views, go through Bridge; other images get a page. ``path``:
    frame folder, folder of frame folders, quilt or film of quilts by its name, or another image for the panel;
    ``display``: index or name of one of Bridge's displays, or SCREEN; None for the first that has the image's
    proportions, or the first if none has a quilt's. ``fps``: of an animation. LfsrError without image, Bridge, display.
    """
    path, images, seconds, options = Path(path), list[Path](), 1.0, ExportOptions(fps=fps, tell=tell)
    if path.is_dir():
        frames, page = frame_folders(path, (EIA_FILE, PANEL_FILE)), path / PAGE
        if (playing := find_display(frames[0], display)) is None:
            images = [one / (PANEL_FILE if read_rendered(one).display.is_woven else EIA_FILE) for one in frames]
            for image in images:
                if not image.is_file():
                    raise LfsrError(f"{image.parent} holds no {image.name}, the panel's image: finish it with `lfsr "
                                    "upscale`")
            seconds = 1 / fps
        else:
            options = dataclasses.replace(options, shape=playing[1].shape)  # the device knows its quilt best
            (path,) = (export(path, "quilt-film", options=options) if len(frames) > 1 else
                       export(frames[0], "quilt", options=dataclasses.replace(options, fps=None)))
    elif not path.is_file():
        raise LfsrError(f"{path} does not exist, expected a frame folder, a quilt or another image: check the path")
    elif (named := read_quilt_name(path.stem)) and min(named.grid) > 0 and display != SCREEN:
        bridge, aspect = Bridge(), named.aspect or float("inf")  # no panel has that, so the order stays
        devices = sorted(bridge.devices(), key=lambda one: abs(_aspect(one, 0) / aspect - 1) > SAME_ASPECT)
        playing = bridge, chosen(devices, display)
    else:
        if display not in (None, SCREEN) or path.suffix.lower() in FILMS:
            raise LfsrError(f"{path.name} is no quilt by its name, expected an ending as in name_qs8x6a0.75.png: "
                            f"rename it if it is one, or show the panel's image on display {SCREEN}")
        with opened(path) as source:
            if source is None:
                raise LfsrError(f"{path} holds no image, expected a frame folder, a quilt or another image: check the "
                                "path")
        # The page of somebody else's file lies in our own folder, not beside it.
        playing, images, page = None, [path], cache_folder() / PAGE
        page.parent.mkdir(parents=True, exist_ok=True)
    if playing is None:
        write_screen_page(page, images, seconds)
        return Shown("The browser shows it full screen: move its window to the display and click into it", page)
    playing[0].play(path, playing[1])
    return Shown(f"{path.name} is shown on {playing[1].name} ({playing[1].hardware})")


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


def write_screen_page(path: Path, images: Sequence[Path], seconds: float) -> None:
    """Write the page of an image, or of several that follow each other after ``seconds``, over and over.

    It reads the images where they lie and fetches nothing else. In full screen it compares its size in the display's
    pixels with the image's, and says what is wrong where they differ.
    """
    data = json.dumps({"images": [image.resolve().as_uri() for image in images], "seconds": seconds})
    parts = {"TITLE": html.escape(images[0].parent.name), "DATA": data.replace("<", "\\u003c")}
    text = re.sub("TITLE|DATA", lambda mark: parts[mark[0]], TEMPLATE.read_text(encoding="utf-8"), count=2)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
