"""What tests of the panel share."""

import pytest

from tests.support import panel


@pytest.fixture
def scene(tmp_path):
    """An artist's scene with the add-on on."""
    with panel.registered():
        yield panel.artist_scene(tmp_path)
