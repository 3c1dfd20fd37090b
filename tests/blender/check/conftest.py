"""A scene that the check finds nothing wrong with, to be spoilt by each test."""

import pytest


@pytest.fixture
def scene(artist):
    """An artist's scene with the add-on on."""
    artist.cycles.pixel_filter_type, artist.cycles.use_denoising = "BOX", False
    return artist
