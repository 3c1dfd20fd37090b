"""What counts as an almost black and an almost white image."""

import numpy as np
import pytest

from lfsr_core.images.view_transform import extreme_tone


@pytest.mark.parametrize(("value", "tone"), [(0, "black"), (8, "black"), (12, ""), (128, ""), (248, ""), (252, "white"),
                                             (255, "white")])
def test_flat_images(value, tone):
    shown = np.full((40, 40, 3), value, np.uint8)
    assert extreme_tone(shown) == tone
    assert extreme_tone(shown.astype(np.float32) / 255) == tone


def test_sparks_and_the_background_do_not_count():
    shown = np.zeros((100, 100, 3), np.uint8)
    shown[:4, :5] = 255
    assert extreme_tone(shown) == "black"
    assert extreme_tone(shown, np.zeros(3, np.uint8)) == "white", "all that is not background"
    shown[:10, :10] = 200
    assert extreme_tone(shown) == ""
    assert extreme_tone(np.zeros((4, 4, 3), np.uint8), np.zeros(3, np.uint8)) == "black"
    assert extreme_tone(np.zeros((0, 3), np.uint8)) == ""
