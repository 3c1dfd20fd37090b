import numpy as np
import pytest

from lfsr_core.base.notices import Notice
from lfsr_core.frames.low_res import foreground_mask, recall, unseen_notices
from tests.support.told import refuses

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


def test_any_hit_however_faint_marks_its_lens_and_no_other():
    mask = foreground_mask(layers(alpha=image((0, 2), (5, 9), value=1e-3)), LENSES)
    assert mask.shape == (4, 5)
    assert marked(mask) == {(0, 0), (2, 3)}
    mask = foreground_mask(layers(alpha=image((0, 0))), LENSES, dilate=1)
    assert marked(mask) == {(0, 0), (0, 1), (1, 0), (1, 1)}
    assert foreground_mask(layers(alpha=image((4, 7))), LENSES, dilate=2).sum() == 20


def test_a_render_without_its_subject_is_said_with_what_it_shows():
    wall = image((0, 0), (1, 1), (2, 2))
    edge = image((0, 0), (1, 1), value=2.0)  # where a ray passed the wall first, the index is 0
    for seen, said in ((layers(), 0.0), (layers(alpha=wall, index=edge), 3 / wall.size)):
        assert unseen_notices(seen) == [Notice("subject-unseen", {"background": said})]
    assert unseen_notices(layers(alpha=wall)) == unseen_notices(layers(alpha=wall, index=image((2, 2)))) == []


def test_background_meshes_are_no_foreground():
    """Everything is covered by a wall (2), an object (1) stands in front of two lenses."""
    index = np.full((8, 15), 2.0)
    index[2, 4] = index[7, 14] = 1
    assert marked(foreground_mask(layers(alpha=np.ones((8, 15)), index=index), LENSES)) == {(1, 1), (3, 4)}
    # The index holds a pixel's first sample only: a thin part is covered yet has index 0.
    mask = foreground_mask(layers(alpha=image((0, 0), (6, 6), value=0.06), index=image((6, 6))), LENSES)
    assert marked(mask) == {(0, 0), (3, 2)}
    index = image((0, 0), value=2.0)
    alpha = image((0, 0), (2, 3), value=0.5)
    assert marked(foreground_mask(layers(alpha=alpha, index=index), LENSES)) == {(1, 1)}


def test_recall():
    reference = np.array([[True, True, False, True]])
    assert recall(np.array([[True, False, False, True]]), reference) == pytest.approx(2 / 3)
    assert recall(np.array([[True, True, True, True]]), reference) == 1
    assert recall(reference, reference) == 1
    assert recall(reference, np.zeros_like(reference)) == 1
    refuses("shapes", recall, reference, reference[:, :2])
