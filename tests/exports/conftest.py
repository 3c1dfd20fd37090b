"""A finished frame that stands turned in the world, and its light field."""

import pytest

from lfsr_core.exports.light_field import read_light_field
from tests.support.finished import TURNED, finished


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return finished(tmp_path_factory.mktemp("finished") / "frame", matrix_world=TURNED)


@pytest.fixture(scope="module")
def field(folder):
    return read_light_field(folder)
