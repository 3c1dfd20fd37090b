"""What tests of jobs share."""

import pytest


@pytest.fixture
def scene(artist):
    """An artist's scene with the add-on on."""
    return artist
