"""Contact sheets show the views where their cameras are."""

import numpy as np

from lfsr_core.frames.views import contact_sheet, epi_pair
from lfsr_core.optics import eia


def numbered(lenses=(16, 12), views=(8, 8)) -> np.ndarray:
    """EIA (H, W, 3) that holds view column, view row and lens column of every pixel."""
    (sx, sy), (px, py) = lenses, views
    v, u, _, i = np.meshgrid(*(np.arange(n, dtype=np.uint8) for n in (py, px, sy, sx)), indexing="ij")
    return eia.from_views(np.stack([u, v, i], axis=-1))


def test_sheet_shows_evenly_spaced_views_in_camera_order():
    sheet = contact_sheet(numbered(), (16, 12), across=4)
    times = 12  # 16 lenses are enlarged to at least 192 pixels
    cell = np.array([12 * times + 4, 16 * times + 4])
    assert sheet.shape == (4 * cell[0] - 4, 4 * cell[1] - 4, 3)
    for row in range(4):
        for column in range(4):
            top, left = row * cell[0], column * cell[1]
            view = sheet[top:top + 12 * times, left:left + 16 * times]
            assert (view[..., 0] == 2 * column + 1).all()
            assert (view[..., 1] == 2 * row + 1).all()
            np.testing.assert_array_equal(view[0, ::times, 2], np.arange(16))


def test_sheet_of_few_views_shows_each_once():
    sheet = contact_sheet(numbered(views=(2, 3)), (16, 12), across=5)
    assert {tuple(pixel) for pixel in sheet.reshape(-1, 3)[:, :2]} == (
        {(u, v) for u in range(2) for v in range(3)} | {(255, 255)})


def test_epi_pair_runs_through_the_middle():
    horizontal, vertical = epi_pair(numbered(), (16, 12))
    assert horizontal.shape == (160, 320, 3)
    assert vertical.shape == (160, 240, 3)
    np.testing.assert_array_equal(horizontal[::20, 0, 0], np.arange(8))  # one row per view column
    assert (horizontal[..., 1] == 4).all()
    np.testing.assert_array_equal(vertical[::20, 0, 1], np.arange(8))
    assert (vertical[..., 0] == 4).all()
    assert (vertical[..., 2] == 8).all()
