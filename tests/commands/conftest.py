"""A scene file and a played Blender for the verbs."""

import pytest

from tests.support.noisy_renders import LOG
from tests.support.played_blender import played_blender


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "my scene.glb"
    path.touch()
    return str(path)


@pytest.fixture
def blender(tmp_path, monkeypatch):
    """Path of a played Blender; the jobs it got are lines of blender.jobs beside it."""
    monkeypatch.setenv(LOG, str(tmp_path / "blender.jobs"))
    return played_blender(tmp_path / "blender")
