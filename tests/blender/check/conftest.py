"""A scene that the check finds nothing wrong with, to be spoilt by each test."""

import pytest

from tests.support import panel


@pytest.fixture
def scene(tmp_path):
    """An artist's scene with the add-on on."""
    with panel.registered():
        scene = panel.artist_scene(tmp_path)
        scene.cycles.pixel_filter_type, scene.cycles.use_denoising = "BOX", False
        yield scene
