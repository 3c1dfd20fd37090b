"""Views of a finished frame and EIAs, both ways."""

import dataclasses

import numpy as np
import pytest

from lfsr_core.base.messages import LfsrError, Notice
from lfsr_core.exports.light_field import contact_sheet, eia_to_views, epi_pair, read_views, views_to_eia
from lfsr_core.images.image_files import read_png
from lfsr_core.optics.rays import from_views
from lfsr_core.reconstruct.second_stage import finish_frame
from lfsr_core.reconstruct.upscaler import foreground_mask, recall, unseen_notices
from tests.support.synthetic import FLAT, MINI, write_render
from tests.support.told import refuses

DIRECT = dataclasses.replace(MINI, ei_order="direct")


def numbered(display=MINI) -> np.ndarray:
    """Views (py, px, sy, sx, 4) that hold the row and column of the view and of the lens."""
    return np.stack(np.indices((*display.views[::-1], *display.lenses[::-1]), np.uint8), -1)


@pytest.mark.parametrize("display", [MINI, DIRECT, FLAT])
def test_views_of_an_eia_of_views_are_the_same(display):
    panel = views_to_eia(numbered(display), display)
    assert panel.shape[:2] == display.eia_pixels[::-1]
    np.testing.assert_array_equal(eia_to_views(panel, display), numbered(display))


def test_the_left_pixel_is_the_rightmost_view_where_the_display_flips_also_of_a_finished_folder(tmp_path):
    assert views_to_eia(numbered(), MINI)[0, 0, :2].tolist() == [7, 7]
    assert views_to_eia(numbered(), DIRECT)[0, 0, :2].tolist() == [0, 0]
    refuses("has 64×96 pixels, but display 'mini' has 128×96", eia_to_views, np.zeros((96, 64, 3), np.uint8), MINI)
    with pytest.raises(LfsrError, match="views have shape .* but display 'mini' needs .8, 8, 12, 16. and channels"):
        views_to_eia(np.zeros((8, 8, 16, 12, 3)), MINI)
    folder = write_render(tmp_path)
    finish_frame(folder, "bilinear")
    views = read_views(folder)
    assert views.shape == (8, 8, 12, 16, 3) and views.dtype == np.uint8 and views.std() > 10
    np.testing.assert_array_equal(views_to_eia(views, MINI), read_png(folder / "eia.png"))


def test_sheets_show_evenly_spaced_views_and_epis_run_through_the_middle():
    eia = from_views(numbered())
    sheet = contact_sheet(eia, (16, 12), across=4)
    times = 12  # 16 lenses are enlarged to at least 192 pixels
    cell = np.array([12 * times + 4, 16 * times + 4])
    assert sheet.shape == (4 * cell[0] - 4, 4 * cell[1] - 4, 4)
    for row in range(4):
        for column in range(4):
            top, left = row * cell[0], column * cell[1]
            view = sheet[top:top + 12 * times, left:left + 16 * times]
            assert (view[..., :2] == (2 * row + 1, 2 * column + 1)).all()
            np.testing.assert_array_equal(view[0, ::times, 3], np.arange(16))
    sheet = contact_sheet(from_views(numbered()[:3, :2]), (16, 12), across=5)
    assert {tuple(pixel) for pixel in sheet.reshape(-1, 4)[:, :2]} == (
        {(row, column) for row in range(3) for column in range(2)} | {(255, 255)})
    horizontal, vertical = epi_pair(eia, (16, 12))
    assert horizontal.shape == (160, 320, 4) and vertical.shape == (160, 240, 4)
    np.testing.assert_array_equal(horizontal[::20, 0, 1], np.arange(8))  # one row per view column
    assert (horizontal[..., 0] == 4).all()
    np.testing.assert_array_equal(vertical[::20, 0, 0], np.arange(8))
    assert (vertical[..., [1, 3]] == (4, 8)).all()


LENSES = (5, 4)  # across, down, of 3 × 2 pixels


def layers(**painted):
    color = np.zeros((8, 15, 4), np.float32)
    result = {"color": color}
    for name, pixels in painted.items():
        if name == "alpha":
            color[..., 3] = pixels
        else:
            result[name] = pixels[..., None].astype(np.float32)
    return result


def image(*pixels, value=1.0):
    image = np.zeros((8, 15), np.float32)
    for row, column in pixels:
        image[row, column] = value
    return image


def marked(mask):
    return {tuple(map(int, lens)) for lens in np.argwhere(mask)}


def test_any_hit_however_faint_marks_its_lens_and_no_subject_is_said_with_what_is_shown():
    mask = foreground_mask(layers(alpha=image((0, 2), (5, 9), value=1e-3)), LENSES)
    assert mask.shape == (4, 5) and marked(mask) == {(0, 0), (2, 3)}
    mask = foreground_mask(layers(alpha=image((0, 0))), LENSES, dilate=1)
    assert marked(mask) == {(0, 0), (0, 1), (1, 0), (1, 1)}
    assert foreground_mask(layers(alpha=image((4, 7))), LENSES, dilate=2).sum() == 20
    wall = image((0, 0), (1, 1), (2, 2))
    edge = image((0, 0), (1, 1), value=2.0)  # where a ray passed the wall first, the index is 0
    for seen, said in ((layers(), 0.0), (layers(alpha=wall, index=edge), 3 / wall.size)):
        assert unseen_notices(seen) == [Notice("subject-unseen", {"background": said})]
    assert unseen_notices(layers(alpha=wall)) == unseen_notices(layers(alpha=wall, index=image((2, 2)))) == []


def test_background_meshes_are_no_foreground_and_recall():
    index = np.full((8, 15), 2.0)
    index[2, 4] = index[7, 14] = 1
    assert marked(foreground_mask(layers(alpha=np.ones((8, 15)), index=index), LENSES)) == {(1, 1), (3, 4)}
    # The index holds a pixel's first sample only: a thin part is covered yet has index 0.
    mask = foreground_mask(layers(alpha=image((0, 0), (6, 6), value=0.06), index=image((6, 6))), LENSES)
    assert marked(mask) == {(0, 0), (3, 2)}
    index = image((0, 0), value=2.0)
    assert marked(foreground_mask(layers(alpha=image((0, 0), (2, 3), value=0.5), index=index), LENSES)) == {(1, 1)}
    reference = np.array([[True, True, False, True]])
    assert recall(np.array([[True, False, False, True]]), reference) == pytest.approx(2 / 3)
    assert recall(np.array([[True, True, True, True]]), reference) == 1
    assert recall(reference, reference) == 1 and recall(reference, np.zeros_like(reference)) == 1
    refuses("shapes", recall, reference, reference[:, :2])
