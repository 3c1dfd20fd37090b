"""The command that farms' tasks start."""

import pytest

from tests.support.warm_lfsr import warm_lfsr


@pytest.fixture(scope="session")
def lfsr(tmp_path_factory):
    """The file of the command, with a played Blender in place of the bpy wheel."""
    with warm_lfsr(tmp_path_factory.mktemp("lfsr")) as path:
        yield path
