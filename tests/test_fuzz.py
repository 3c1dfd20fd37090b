"""Damaged data from outside: every outcome is success or one sentence, in bounded memory.

400 cases of every kind; the 5000 of each marked ``long`` run with ``pytest -m long``.
"""

import functools
import io
import json
import math
import random
import resource
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from lfsr_core.base.messages import MOST_CHARACTERS, LfsrError, Notice
from lfsr_core.base.records import to_data
from lfsr_core.calibration.makers import profile_from_calibration, read_calibration
from lfsr_core.calibration.photograph import read_photograph
from lfsr_core.exports import images
from lfsr_core.exports.importing import quilt_of, read_film, read_quilt
from lfsr_core.frames.frame import FRAME_FILE, REPORT_FILE, read_frame
from lfsr_core.frames.request import Finish, Report, read_report, read_request, write_report
from lfsr_core.images.image_files import read_finite, read_layers, read_mask, read_png, write_mask
from lfsr_core.optics.display import load_display, write_profile
from lfsr_core.optics.panel.weave import gather_map
from lfsr_core.reconstruct.methods import denoise
from lfsr_core.reconstruct.upscaler import foreground_mask, low_resolution
from tests.calibration.test_makers import OLD, written
from tests.support.damage import damaged
from tests.support.panels import hexagonal, lenticular
from tests.support.requests import make_request
from tests.support.synthetic import MINI, frame_of, write_render

MOST_MEMORY = 2**31  # bytes beyond what the tests hold already
CASES, MANY_CASES = 400, 5000


def render_files(folder: Path) -> dict[str, bytes]:
    """What a rendered and finished folder holds, by name."""
    write_render(folder)
    write_report(folder, Report(Finish("bilinear"), "bilinear", "mini", 2, 16, {"render": 1.0}, None, 0.3,
                                (Notice("subject-unseen", {"background": 0.0}),), {"ssim_eia": 0.5}))
    write_mask(folder / "mask.png", read_layers(folder / "lr_eia.exr")["color"][..., 3] > 0)
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def use_sheet(path: Path) -> None:
    display = load_display(path)
    if display.is_woven and math.prod(display.panel_pixels) < 10**5:
        assert gather_map(display, "nearest").first.min() >= 0


def denoiser_weights(path: Path) -> bytes:
    """The smallest network, of whose bytes a third are the table."""
    shapes = denoise.network_shapes((1,) * 15 + (3,))
    denoise.write_tza(path, {name: np.full(shape, 0.1) for name, shape in shapes.items()})
    return path.read_bytes()


def telephone_jpeg() -> bytes:
    """A small photograph, stored turned, as EXIF says."""
    file, exif = io.BytesIO(), Image.Exif()
    exif[0x0112] = 6
    picture = np.random.default_rng(0).integers(0, 255, (24, 32, 3), np.uint8)
    Image.fromarray(picture).save(file, "jpeg", exif=exif)
    return file.getvalue()


class SilentError(Exception):
    """Another picture, without a word."""


def use_picture(path: Path) -> None:
    layers, replaced = read_finite(path)
    low_resolution(layers, frame_of(2))
    foreground_mask(layers, MINI.lenses)
    if not replaced and not np.array_equal(layers["color"], rendered()):
        raise SilentError


@functools.cache
def rendered() -> np.ndarray:
    """The picture that ``render_files`` writes."""
    with tempfile.TemporaryDirectory() as name:
        return read_layers(write_render(Path(name)) / "lr_eia.exr")["color"]


def film_bytes(path: Path) -> bytes:
    """A film of two quilts."""
    pixels = rendered()[..., :3]
    frames = iter([np.rint(np.clip(pixels, 0, 1) * 255).astype(np.uint8)] * 2)
    images.write_film(path, frames, 10)
    return path.read_bytes()


KINDS: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "frame": (FRAME_FILE, lambda path: read_frame(path.parent).rays.tiles),
    "report": (REPORT_FILE, lambda path: read_report(path.parent)),
    "job": ("job.json", read_request), "profile": ("profile.toml", load_display), "exr": ("lr_eia.exr", use_picture),
    "cylinders": ("cylinders.toml", use_sheet), "hexagonal": ("hexagonal.toml", use_sheet),
    "png": ("mask.png", lambda path: (read_mask(path), read_png(path))), "photo": ("photo.jpg", read_photograph),
    "quilt": ("mask_qs2x2a1.png", lambda path: read_quilt(path, quilt_of(path))),
    "quilt film": ("film_qs2x2a1.mp4", lambda path: list(read_film(path, quilt_of(path)))),
    "calibration": ("visual.json", lambda path: profile_from_calibration(read_calibration(path), "fuzz")),
    "denoiser": ("denoiser.tza", lambda path: denoise._load.__wrapped__(path, 0))}


@pytest.fixture(scope="module")
def good(tmp_path_factory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("good")
    files = render_files(folder) | {"denoiser.tza": denoiser_weights(folder / "denoiser.tza")}
    files |= {"mask_qs2x2a1.png": files["mask.png"], "film_qs2x2a1.mp4": film_bytes(folder / "film_qs2x2a1.mp4"),
              "visual.json": written(folder, OLD).read_bytes(),
              "photo.jpg": telephone_jpeg()}
    for name, display in (("profile", MINI), ("cylinders", lenticular()), ("hexagonal", hexagonal())):
        write_profile(folder / f"{name}.toml", display)
        files[f"{name}.toml"] = (folder / f"{name}.toml").read_bytes()
    job = make_request("out", MINI, "scene.blend", layers=("albedo",), lens_list=((0, 0), (1, 1)), scale=2)
    return files | {"job.json": json.dumps(to_data(job)).encode()}


@pytest.fixture
def bounded():
    """Little memory beyond what the process has taken already."""
    taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (taken + MOST_MEMORY, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


@pytest.mark.parametrize("cases", [CASES, pytest.param(MANY_CASES, marks=pytest.mark.long)])
@pytest.mark.parametrize("kind", KINDS)
def test_damaged_data_is_read_or_refused_in_a_sentence(tmp_path, good, bounded, kind, cases):
    name, read = KINDS[kind]
    path = tmp_path / name
    path.write_bytes(good[name])
    read(path)
    silent = []
    for number in range(cases):
        path.write_bytes(damaged(good[name], name, random.Random(f"{kind} {number}")))
        try:
            read(path)
        except LfsrError as error:
            assert 0 < len(str(error)) <= MOST_CHARACTERS and "\n" not in str(error), number
        except SilentError:
            silent.append(number)
    assert len(silent) <= cases // 2500, silent  # ZIP's Adler-32 does not notice each flip: measured, 1 of 5000
