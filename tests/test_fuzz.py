"""Damaged data from outside, 400 inputs of a kind, 5000 with ``-m long``: success or one sentence, little memory."""

import math
import resource
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lfsr_core.base.messages import Notice
from lfsr_core.base.records import to_data
from lfsr_core.base.system import write_json
from lfsr_core.calibration.makers import profile_from_calibration, read_calibration
from lfsr_core.calibration.photograph import read_photograph
from lfsr_core.exports import images
from lfsr_core.exports.importing import quilt_of, read_film, read_quilt
from lfsr_core.frames import frame as records
from lfsr_core.frames.frame import LOW_RES_FILE, Finish, Report, read_frame, read_report, read_request, write_report
from lfsr_core.images.image_files import read_finite, read_mask, read_png, write_mask
from lfsr_core.optics.display import load_display, write_profile
from lfsr_core.optics.panel.weave import gather_map
from lfsr_core.pipeline.parts import INPUTS_FILE, remove_others
from lfsr_core.reconstruct.methods import denoise
from lfsr_core.reconstruct.upscaler import foreground_mask, low_resolution
from lfsr_lab.networks.tza import write_tza
from tests.calibration.test_makers import OLD, written
from tests.support.damage import SILENT, WRONG, Case, outcomes
from tests.support.panels import hexagonal, lenticular
from tests.support.requests import make_request
from tests.support.synthetic import MINI, frame_of, light_field, write_render

MOST_MEMORY = 2**31  # bytes beyond what the tests hold already
INPUTS, MANY_INPUTS = 400, 5000


def use_sheet(folder: Path) -> None:
    display = load_display(folder / "profile.toml")
    if display.is_woven and math.prod(display.panel_pixels) < 10**5:
        assert gather_map(display, "nearest").first.min() >= 0


def write_weights(path: Path) -> Path:
    """The smallest network, of whose bytes a third are the table."""
    shapes = denoise.network_shapes((1,) * 15 + (3,))
    write_tza(path, {name: np.full(shape, 0.1) for name, shape in shapes.items()})
    return path


def write_photograph(folder: Path) -> None:
    """A small photograph, stored turned, as EXIF says."""
    exif = Image.Exif()
    exif[0x0112] = 6
    picture = np.random.default_rng(0).integers(0, 255, (24, 32, 3), np.uint8)
    Image.fromarray(picture).save(folder / "photo.jpg", exif=exif)


def use_picture(folder: Path) -> None:
    """Read the render, and write what was read, for others to compare."""
    layers, replaced = read_finite(folder / LOW_RES_FILE)
    low_resolution(layers, frame_of(2))
    foreground_mask(layers, MINI.lenses)
    (folder / "read").write_bytes(layers["color"].tobytes())
    if replaced:
        print("note: pixels were replaced", file=sys.stderr)


def write_film(path: Path) -> None:
    """A film of two quilts."""
    images.write_film(path, iter([np.rint(np.clip(light_field()[..., :3], 0, 1) * 255).astype(np.uint8)] * 2), 10)


REPORT = Report(Finish("bilinear"), "bilinear", "mini", 2, 16, {"render": 1.0}, None, 0.3,
                (Notice("subject-unseen", {"background": 0.0}),), {"ssim_eia": 0.5})
JOB = make_request("out", MINI, "scene.blend", layers=("albedo",), lens_list=((0, 0), (1, 1)), scale=2)
INPUTS_OF_PARTS = {"settings": "a", "scene file": "b"}
QUILT, FILM = "mask_qs2x2a1.png", "film_qs2x2a1.mp4"


def case(name: str, make: Callable[[Path], object], read: Callable[[Path], object], pictures: tuple[str, ...] = ()):
    """A file that ``make`` writes into a folder, and what reads it there."""
    return Case(make, {name: name}, lambda folder: read(folder) and None, pictures)


READERS = {
    "frame": case(records.FRAME_FILE, write_render, lambda folder: read_frame(folder).rays.tiles),
    "report": case(records.REPORT_FILE, lambda folder: write_report(folder, REPORT), read_report),
    "job": case("job.json", lambda folder: write_json(folder / "job.json", to_data(JOB)),
                lambda folder: read_request(folder / "job.json")),
    "parts": case(f"parts/{INPUTS_FILE}", lambda folder: write_json(folder / "parts" / INPUTS_FILE, INPUTS_OF_PARTS),
                  lambda folder: remove_others(folder / "parts", {"settings": "a"})),
    **{name: case("profile.toml", lambda folder, display=display: write_profile(folder / "profile.toml", display),
                  use_sheet)
       for name, display in (("profile", MINI), ("cylinders", lenticular()), ("hexagonal", hexagonal()))},
    "exr": case(LOW_RES_FILE, write_render, use_picture, ("read",)),
    "png": case(records.MASK_FILE, lambda folder: write_mask(folder / records.MASK_FILE, np.eye(12, 16) > 0),
                lambda folder: (read_mask(folder / records.MASK_FILE), read_png(folder / records.MASK_FILE))),
    "photo": case("photo.jpg", write_photograph, lambda folder: read_photograph(folder / "photo.jpg").size),
    "quilt": case(QUILT, lambda folder: write_mask(folder / QUILT, np.eye(12, 16) > 0),
                  lambda folder: read_quilt(folder / QUILT, quilt_of(folder / QUILT)).size),
    "quilt film": case(FILM, lambda folder: write_film(folder / FILM),
                       lambda folder: list(read_film(folder / FILM, quilt_of(folder / FILM)))),
    "calibration": case("visual.json", lambda folder: written(folder, OLD),
                        lambda folder: profile_from_calibration(read_calibration(folder / "visual.json"), "fuzz")),
    "denoiser": case("denoiser.tza", lambda folder: write_weights(folder / "denoiser.tza"),
                     lambda folder: denoise._load.__wrapped__(folder / "denoiser.tza", 0))}


@pytest.fixture
def bounded():
    """Little memory beyond what the process has taken already."""
    taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (taken + MOST_MEMORY, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


@pytest.mark.parametrize("inputs", [INPUTS, pytest.param(MANY_INPUTS, marks=pytest.mark.long)])
@pytest.mark.parametrize("kind", READERS)
def test_damaged_data_is_read_or_refused_in_a_sentence(tmp_path, bounded, kind, inputs):
    wrong = [(number, result) for _, number, result in outcomes(READERS[kind], tmp_path / "case", inputs, kind)
             if result.outcome in WRONG]
    silent = [number for number, result in wrong if result.outcome == SILENT]
    assert len(wrong) == len(silent), wrong
    # ZIP's Adler-32 does not notice each flip of a bit: one of the 400 changes six pixels of an EXR.
    assert len(silent) <= math.ceil(inputs / 2500), silent
