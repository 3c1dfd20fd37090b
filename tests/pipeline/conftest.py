"""The command that farms' tasks start."""

import pytest

from tests.support.played_blender import warm_lfsr


@pytest.fixture(scope="session")
def lfsr(tmp_path_factory):
    """The file of the command, with a played Blender in place of the bpy wheel."""
    return warm_lfsr(tmp_path_factory.mktemp("lfsr"))
