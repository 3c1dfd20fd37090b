"""A finished frame that stands turned in the world, its light field, and a browser."""

import pytest

from lfsr_core.exports.light_field import read_light_field
from lfsr_core.images.image_files import read_png, write_png
from tests.support.browser import chromium
from tests.support.finished import TURNED, finished

NAMES = ("0002", "0010", "10000")  # of a film's frames; by name the last would come before the second


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return finished(tmp_path_factory.mktemp("finished") / "frame", matrix_world=TURNED)


@pytest.fixture(scope="module")
def field(folder):
    return read_light_field(folder)


@pytest.fixture(scope="session")
def browser():
    with chromium() as running:
        yield running


@pytest.fixture(scope="session")
def film(tmp_path_factory):
    """Three frames, each darker than the one before, and what else may lie beside them."""
    folder = tmp_path_factory.mktemp("film")
    for number, name in enumerate(NAMES, 1):
        frame = finished(folder / name, frame=int(name))
        write_png(frame / "eia.png", read_png(frame / "eia.png") // number)
    finished(folder / "0002_reference")
    (folder / "0002_reference" / "eia.png").unlink()
    (folder / "parts").mkdir()
    return folder
