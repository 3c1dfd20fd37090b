"""``lfsr show``: what goes where, and the sentences where it cannot."""

import json
import re
import sys
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

import av
import numpy as np
import pytest

from lfsr_core.cli import main
from lfsr_core.exports import loopback
from lfsr_core.frames.frame import SUBPIXELS, write_frame
from lfsr_core.images.image_files import read_png, write_png
from tests.calibration.test_makers import OLD
from tests.support.bridge import DEVICES, device
from tests.support.finished import MINI, finished
from tests.support.panels import cells, lenticular, small
from tests.support.synthetic import fails, frame_of

OWN = device(3, "LKG-S3", "small", OLD | {"screenW": 240, "screenH": 160})
DISPLAY = small(lenticular())


@pytest.fixture(autouse=True)
def browser(tmp_path_factory, monkeypatch):
    """A browser that notes what it is asked to open."""
    folder = tmp_path_factory.mktemp("browser")
    (folder / "browser.py").write_text("import sys\nopen(sys.argv[0] + '.txt', 'a').write(sys.argv[1] + '\\n')\n")
    monkeypatch.setenv("BROWSER", f"{sys.executable} {folder / 'browser.py'} %s")
    monkeypatch.setenv(loopback.PORT_VARIABLE, "1")  # nobody listens there
    opened = folder / "browser.py.txt"
    return lambda: opened.read_text().split() if opened.is_file() else []


def frame(folder: Path, display=DISPLAY, **changes) -> Path:
    """Finished frame with its panel's image."""
    finished(folder, display, **changes)
    if display.is_woven:
        write_png(folder / "panel.png", np.zeros((*display.panel_pixels[::-1], 3), np.uint8))
    return folder


def direct(folder: Path, **changes) -> Path:
    """Finished frame of direct subpixel rendering."""
    folder.mkdir(parents=True)
    write_frame(folder, frame_of(1, small(cells()), layout=SUBPIXELS, **changes))
    write_png(folder / "panel.png", np.zeros((80, 120, 3), np.uint8))
    return folder


def images(page: Path) -> dict:
    return json.loads(re.search(r'application/json">(.*)</script>', page.read_text(encoding="utf-8"))[1])


def test_a_lenticular_frame_goes_through_bridge_as_a_quilt_and_an_animation_as_a_film(bridge, browser, tmp_path,
                                                                                      capsys):
    stand_in = bridge(devices=[*DEVICES, OWN])
    assert main(["show", str(frame(tmp_path / "frame"))]) == 0
    (quilt,) = map(Path, stand_in.shown)
    entry = next(request["body"] for request in stand_in.requests if request["endpoint"] == "insert_playlist_entry")
    assert read_png(quilt).std() > 10 and quilt.parent == (tmp_path / "frame" / "export" / "quilt").resolve()
    assert entry["cols"] * entry["rows"] == entry["view_count"] == DISPLAY.views[0] and entry["aspect"] == 1.5
    assert f"{quilt.name} is shown on LKG-S3 (small)" in capsys.readouterr().out and browser() == []
    stand_in = bridge(devices=[OWN])
    for number in (1, 2, 3):
        frame(tmp_path / "film" / f"{number}", frame=number)
    assert main(["show", str(tmp_path / "film"), "--fps", "12"]) == 0
    with av.open(stand_in.shown[0]) as film:
        assert film.streams.video[0].average_rate == 12 and len(list(film.decode(video=0))) == 3
    assert stand_in.requests[-1]["endpoint"] == "play_playlist"
    entry = next(request["body"] for request in stand_in.requests if request["endpoint"] == "insert_playlist_entry")
    assert entry["cols"] * entry["rows"] == entry["view_count"] == DISPLAY.views[0]


@pytest.mark.parametrize(("stated", "grid"), [({"tileX": 4, "tileY": 2, "quiltX": 401, "quiltY": 200}, (4, 2)),
                                              ({"tileX": 4, "tileY": 0, "quiltX": 400, "quiltY": 200}, None),
                                              ({"tileX": "4", "tileY": 2}, None)])
def test_a_device_that_states_its_quilt_gets_that(bridge, tmp_path, stated, grid):
    stand_in = bridge(devices=[device(3, "LKG-S3", "small", OLD | {"screenW": 240, "screenH": 160}, stated)])
    assert main(["show", str(frame(tmp_path / "frame"))]) == 0
    entry = next(request["body"] for request in stand_in.requests if request["endpoint"] == "insert_playlist_entry")
    assert (entry["cols"], entry["rows"]) == grid if grid else entry["view_count"] == DISPLAY.views[0]
    if grid:
        assert read_png(stand_in.shown[0]).shape[:2] == (200, 400)


def test_a_quilt_goes_to_a_panel_of_its_proportions_and_without_has_the_panels(bridge, tmp_path):
    stand_in = bridge()
    for name, options, index, aspect in (("", ["--display", "2"], 2, 16 / 9), ("", [], 1, 0.75),
                                         ("a1.778", [], 2, 1.778), ("a1.2", [], 1, 1.2)):
        write_png(quilt := tmp_path / f"theirs_qs8x6{name}.png", np.zeros((60, 80, 3), np.uint8))
        assert main(["show", str(quilt), *options]) == 0
        entry = [request["body"] for request in stand_in.requests if request["endpoint"] == "insert_playlist_entry"][-1]
        assert entry["aspect"] == aspect and (entry["cols"], entry["rows"]) == (8, 6)
        assert stand_in.shown == [str(quilt.resolve())] and stand_in.requests[-1]["body"]["head_index"] == index


@pytest.mark.parametrize(("make", "name", "options"), [
    (lambda folder: frame(folder, MINI), "eia.png", []), (frame, "panel.png", ["--display", "screen"]),
    (direct, "panel.png", []), (direct, "panel.png", ["--display", "screen"])])
def test_a_panels_own_image_is_opened_in_the_browser(browser, tmp_path, capsys, make, name, options):
    folder = make(tmp_path / "frame")
    assert main(["show", str(folder), *options]) == 0
    page = folder / "show.html"
    assert images(page) == {"images": [(folder / name).resolve().as_uri()], "seconds": pytest.approx(1 / 24)}
    assert browser() == [page.resolve().as_uri()]
    assert f"{page}: The browser shows it full screen: move its window" in capsys.readouterr().out


def test_any_image_is_shown_full_screen(browser, tmp_path, capsys):
    write_png(image := tmp_path / "DATA" / "phase.png", np.zeros((60, 80, 3), np.uint8))
    assert main(["show", str(image)]) == 0
    (page,) = browser()
    assert images(Path(url2pathname(urlsplit(page).path)))["images"] == [image.resolve().as_uri()]
    assert [path.name for path in tmp_path.rglob("*.html")] == [], "nothing lies beside the file"
    capsys.readouterr()
    for content in [b"root:x:0:0", b"", b"\x89PNG\r\n", b"<html></html>"]:
        (tmp_path / "secret.png").write_bytes(content)
        assert "secret.png holds no image" in fails(["show", str(tmp_path / "secret.png")], capsys)
        assert not list(tmp_path.glob("*.html"))


@pytest.mark.parametrize("make", [lambda folder, **changes: frame(folder, MINI, **changes), direct])
def test_an_animation_full_screen(tmp_path, make):
    for number in (1, 2, 10):
        make(tmp_path / "film" / f"{number}", frame=number)
    assert main(["show", str(tmp_path / "film"), "--fps", "12"]) == 0
    shown = images(tmp_path / "film" / "show.html")
    assert [Path(image).parent.name for image in shown["images"]] == ["1", "2", "10"]
    assert shown["seconds"] == pytest.approx(1 / 12)


def test_other_proportions_are_refused_before_the_export_and_without_a_browser_it_says_what_to_do(bridge, tmp_path,
                                                                                                  capsys, monkeypatch):
    stand_in, folder = bridge(), frame(tmp_path / "frame")
    assert "the image is made for a panel of width / height 1.500, but display 'LKG-P1' has 0.750" in fails(
        ["show", str(folder)], capsys)
    assert not (folder / "export").exists() and stand_in.endpoints[-1] == "available_output_devices"
    (opener := tmp_path / "xdg-open").write_text("#!/bin/sh\nexit 3\n")  # where there is none
    opener.chmod(0o755)
    for name, value in {"BROWSER": "missing", "PATH": str(tmp_path), "DISPLAY": ":0"}.items():
        monkeypatch.setenv(name, value)
    for verb in (["show"], ["view", "--open"]):
        assert main([*verb, str(frame(tmp_path / verb[0], MINI))]) == 0
        assert "note: no browser was found here: open that page yourself" in capsys.readouterr().err


@pytest.mark.parametrize(("make", "options", "message"), [
    (lambda folder: folder / "none", [], "none does not exist, expected a frame folder, a quilt"),
    (lambda folder: folder, [], "is no frame folder and holds none with an eia.png or panel.png"),
    (lambda folder: direct(folder / "a"), ["--display", "LKG-P1"], "a holds the panel's image alone, but display"),
    (lambda folder: frame(folder / "a"), ["--fps", "0"], "fps is 0"),
    (lambda folder: frame(folder / "a"), ["--fps", "nan"], "fps is nan"),
    (lambda folder: frame(folder / "a"), [], "Looking Glass Bridge is not running: nothing listens on port 1"),
    (lambda folder: finished(folder / "a", DISPLAY), ["--display", "screen"],
     "holds no panel.png, the panel's image: finish it with `lfsr upscale`")])
def test_what_cannot_be_shown(tmp_path, capsys, make, options, message):
    assert message in fails(["show", str(make(tmp_path)), *options], capsys)
    assert not [*tmp_path.rglob("show.html"), *tmp_path.rglob("export")]


@pytest.mark.parametrize(("name", "options"), [("film.mp4", []), ("picture.png", ["--display", "LKG-P1"]),
                                               ("picture_qs0x6a1.png", ["--display", "1"])])
def test_a_file_without_a_quilts_name(bridge, tmp_path, capsys, name, options):
    bridge()
    (tmp_path / name).write_bytes(b"x")
    assert f"{name} is no quilt by its name, expected an ending as in name_qs8x6a0.75.png" in fails(
        ["show", str(tmp_path / name), *options], capsys)
