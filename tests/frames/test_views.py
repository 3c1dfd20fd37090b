"""Views of a finished frame and EIAs, both ways."""

import dataclasses

import numpy as np
import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.views import eia_to_views, read_views, views_to_eia
from lfsr_core.images.png import read_png
from lfsr_core.pipeline.make import finish_frame
from tests.support.synthetic import FLAT, MINI, write_render
from tests.support.told import refuses

DIRECT = dataclasses.replace(MINI, ei_order="direct")


def numbered(display=MINI) -> np.ndarray:
    """Views (py, px, sy, sx, 4) that hold the row and column of the view and of the lens."""
    shape = (*display.views[::-1], *display.lenses[::-1])
    return np.stack(np.indices(shape, np.uint8), -1)


@pytest.mark.parametrize("display", [MINI, DIRECT, FLAT])
def test_views_of_an_eia_of_views_are_the_same(display):
    panel = views_to_eia(numbered(display), display)
    assert panel.shape[:2] == display.eia_pixels[::-1]
    np.testing.assert_array_equal(eia_to_views(panel, display), numbered(display))


def test_the_left_pixel_behind_a_lens_is_the_rightmost_view_where_the_display_flips():
    assert views_to_eia(numbered(), MINI)[0, 0, :2].tolist() == [7, 7]
    assert views_to_eia(numbered(), DIRECT)[0, 0, :2].tolist() == [0, 0]


def test_views_of_a_finished_folder(tmp_path):
    folder = write_render(tmp_path)
    finish_frame(folder, "bilinear")
    views = read_views(folder)
    assert views.shape == (8, 8, 12, 16, 3) and views.dtype == np.uint8 and views.std() > 10
    np.testing.assert_array_equal(views_to_eia(views, MINI), read_png(folder / "eia.png"))


def test_arrays_of_another_shape_are_refused():
    refuses("has 64×96 pixels, but display 'mini' has 128×96", eia_to_views, np.zeros((96, 64, 3), np.uint8), MINI)
    with pytest.raises(LfsrError, match="views have shape .* but display 'mini' needs .8, 8, 12, 16. and channels"):
        views_to_eia(np.zeros((8, 8, 16, 12, 3)), MINI)
