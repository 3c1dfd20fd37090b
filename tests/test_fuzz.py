"""Damaged data from outside: every outcome is success or one sentence, in bounded memory.

200 cases of every kind; the 5000 of each marked ``long`` run with ``pytest -m long``.
"""

import copy
import functools
import io
import json
import resource
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from lfsr_core.base.errors import MOST_CHARACTERS, LfsrError
from lfsr_core.base.notices import Notice
from lfsr_core.base.records import to_data
from lfsr_core.calibration.photograph import read_photograph
from lfsr_core.calibration.visual_json import profile_from_calibration, read_calibration
from lfsr_core.exports import films
from lfsr_core.exports.sources import quilt_of, read_film, read_quilt
from lfsr_core.frames.finish import Finish, Report, read_report, write_report
from lfsr_core.frames.frame import FRAME_FILE, REPORT_FILE, read_frame
from lfsr_core.frames.low_res import foreground_mask, low_resolution
from lfsr_core.frames.request import read_request
from lfsr_core.images.exr import read_finite, read_layers
from lfsr_core.images.png import read_mask, read_png, write_mask
from lfsr_core.optics.display import load_display
from lfsr_core.reconstruct import denoiser
from tests.support.requests import make_request
from tests.support.synthetic import MINI, frame_of, write_render

CALIBRATION = {"pitch": 52.6, "slope": -7.1, "center": 0.8, "DPI": 324, "screenW": 1536, "screenH": 2048}
MOST_MEMORY = 2**31  # bytes beyond what the tests hold already
CASES, MANY_CASES = 200, 5000
SPECIAL = ["", "\ud800", "x" * 5000, "../" * 50, -1, 0, 2**32, 10**400, 1e308, -0.0, None, True, [], {}, [[]] * 100]
ODD = st.sampled_from(SPECIAL) | st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3), max_leaves=5)
ODD_TEXT = st.sampled_from(["NaN", "Infinity", "-Infinity", "1e999", "[" * 1000, "{" * 1000, "9" * 400, "9" * 5000,
                            '"' + "x" * 5000 + '"', '"\\ud800"', "0x1", ""])


def places(data: Any) -> list[tuple[Any, Any]]:
    """Every (container, key) inside JSON ``data``."""
    entries = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [place for key, value in entries for place in ((data, key), *places(value))]


@st.composite
def damaged_json(draw: st.DrawFn, good: str) -> bytes:
    """JSON text with one to three values replaced, removed or joined by others, or a token no JSON has."""
    data = json.loads(good)
    for _ in range(draw(st.integers(1, 3))):
        container, key = draw(st.sampled_from(places(data) or [({"": 0}, "")]))
        change = draw(st.sampled_from(["replace", "replace", "token", "remove", "add"]))
        if change == "remove":
            container.pop(key)
        elif change == "add" and isinstance(container, dict):
            container[draw(st.text())] = copy.deepcopy(draw(ODD))
        else:
            container[key] = "TOKEN" if change == "token" else copy.deepcopy(draw(ODD))
    return json.dumps(data).replace('"TOKEN"', draw(ODD_TEXT)).encode()


@st.composite
def damaged_bytes(draw: st.DrawFn, good: bytes) -> bytes:
    """A file with some bytes changed, mostly in its header, cut out, doubled, or cut off."""
    data = bytearray(good)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, min(len(data), 700)) | st.integers(0, len(data)))
        change = draw(st.sampled_from(["set", "set", "cut", "double", "end"]))
        piece = draw(st.binary(min_size=1, max_size=8) | st.sampled_from([b"\xff" * 4, b"\0" * 4, b"\x7f\xff\xff\xff"]))
        if change == "set":
            data[at:at + len(piece)] = piece
        elif change == "cut":
            del data[at:at + len(piece)]
        elif change == "double":
            data[at:at] = data[at:at + 50]
        else:
            del data[max(at, 1):]
    return bytes(data)


def render_files(folder: Path) -> dict[str, bytes]:
    """What a rendered and finished folder holds, by name."""
    write_render(folder)
    write_report(folder, Report(Finish("bilinear"), "bilinear", "mini", 2, 16, {"render": 1.0}, None, 0.3,
                                (Notice("subject-unseen", {"background": 0.0}),), {"ssim_eia": 0.5}))
    write_mask(folder / "mask.png", read_layers(folder / "lr_eia.exr")["color"][..., 3] > 0)
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def toml(data: dict[str, Any]) -> bytes:
    """A profile as TOML, in which JSON's values are nearly always valid."""
    return "\n".join(f"{key} = {json.dumps(value)}" for key, value in data.items()).encode()


def profile_text(data: bytes) -> bytes:
    try:
        return toml(json.loads(data))
    except (ValueError, RecursionError, AttributeError):
        return data


def read_denoiser(path: Path) -> None:
    denoiser._load.__wrapped__(path, 0)


def denoiser_weights(path: Path) -> bytes:
    """The smallest network, of whose bytes a third are the table."""
    shapes = denoiser.network_shapes((1,) * 15 + (3,))
    denoiser.write_tza(path, {name: np.full(shape, 0.1) for name, shape in shapes.items()})
    return path.read_bytes()


def telephone_jpeg() -> bytes:
    """A small photograph, stored turned, as EXIF says."""
    file, exif = io.BytesIO(), Image.Exif()
    exif[0x0112] = 6
    picture = np.random.default_rng(0).integers(0, 255, (24, 32, 3), np.uint8)
    Image.fromarray(picture).save(file, "jpeg", exif=exif)
    return file.getvalue()


def use_frame(path: Path) -> None:
    frame = read_frame(path.parent)
    assert frame.rays.size and frame.rays.tiles


def use_picture(path: Path) -> None:
    layers, replaced = read_finite(path)
    low_resolution(layers, frame_of(2))
    foreground_mask(layers, MINI.lenses)
    assert replaced or np.array_equal(layers["color"], rendered()), "another picture without a word"


@functools.cache
def rendered() -> np.ndarray:
    """The picture that ``render_files`` writes."""
    with tempfile.TemporaryDirectory() as name:
        return read_layers(write_render(Path(name)) / "lr_eia.exr")["color"]


def read_pictures(path: Path) -> None:
    read_mask(path)
    read_png(path)


def film_bytes(path: Path) -> bytes:
    """A film of two quilts."""
    pixels = rendered()[..., :3]
    frames = iter([np.rint(np.clip(pixels, 0, 1) * 255).astype(np.uint8)] * 2)
    films.write_film(path, frames, 10)
    return path.read_bytes()


def read_frames(path: Path) -> None:
    for taken, _ in read_film(path, quilt_of(path)):
        assert taken.views.shape[1] == 4


KINDS: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "frame": (FRAME_FILE, use_frame), "report": (REPORT_FILE, lambda path: read_report(path.parent)),
    "job": ("job.json", read_request), "profile": ("profile.toml", load_display), "exr": ("lr_eia.exr", use_picture),
    "png": ("mask.png", read_pictures), "photo": ("photo.jpg", read_photograph),
    "quilt": ("mask_qs2x2a1.png", lambda path: read_quilt(path, quilt_of(path))),
    "quilt film": ("film_qs2x2a1.mp4", read_frames),
    "calibration": ("visual.json", lambda path: profile_from_calibration(read_calibration(path), "fuzz")),
    "denoiser": ("denoiser.tza", read_denoiser)}


@pytest.fixture(scope="module")
def good(tmp_path_factory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("good")
    files = render_files(folder) | {"denoiser.tza": denoiser_weights(folder / "denoiser.tza")}
    files |= {"mask_qs2x2a1.png": files["mask.png"], "film_qs2x2a1.mp4": film_bytes(folder / "film_qs2x2a1.mp4"),
              "visual.json": json.dumps({name: {"value": value} for name, value in CALIBRATION.items()}).encode()}
    files["photo.jpg"] = telephone_jpeg()
    job = make_request("out", MINI, "scene.blend", layers=("albedo",), lens_list=((0, 0), (1, 1)), scale=2)
    return files | {"job.json": json.dumps(to_data(job)).encode(), "profile.toml": json.dumps(MINI.to_dict()).encode()}


@pytest.fixture
def bounded():
    """Little memory beyond what the process has taken already."""
    taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (taken + MOST_MEMORY, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


def attempt(folder: Path, kind: str, data: bytes) -> None:
    name, read = KINDS[kind]
    path = folder / name
    path.write_bytes(profile_text(data) if kind == "profile" else data)
    try:
        read(path)
    except LfsrError as error:
        message = str(error)
        assert 0 < len(message) <= MOST_CHARACTERS and "\n" not in message


def fuzz(folder: Path, kind: str, content: bytes, cases: int) -> None:
    binary = kind in ("exr", "png", "denoiser", "photo", "quilt", "quilt film")
    strategy = damaged_bytes(content) if binary else damaged_json(content.decode()) | damaged_bytes(content)

    @settings(max_examples=cases, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(strategy)
    def every_outcome_is_success_or_a_sentence(data: bytes) -> None:
        attempt(folder, kind, data)

    every_outcome_is_success_or_a_sentence()


@pytest.mark.parametrize("cases", [CASES, pytest.param(MANY_CASES, marks=pytest.mark.long)])
@pytest.mark.parametrize("kind", KINDS)
def test_damaged_data_is_read_or_refused_in_a_sentence(tmp_path, good, bounded, kind, cases):
    attempt(tmp_path, kind, good[KINDS[kind][0]])
    fuzz(tmp_path, kind, good[KINDS[kind][0]], cases)
