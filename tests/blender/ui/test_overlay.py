"""The frustum as drawn is the array."""

import numpy as np
import pytest

from blender_addon.scene.array import rig
from blender_addon.ui import overlay
from lfsr_core.optics.display import load_display

MINI = load_display("mini")


def test_the_drawn_frustum_is_the_array(scene):
    array, _ = rig.placement(scene, MINI)
    near, far = rig.usable_depth(array, MINI)
    drawn = overlay.lines(array, MINI, scale=2)
    depths = {round(float(z), 4) for *_, points in drawn for z in points[:, 2]}
    sparse = rig.usable_depth(array, MINI, 2)
    assert {round(z, 4) for z in (0.0, near, array.distance, far, *sparse)} == depths
    rectangle = overlay.rectangle(array, array.distance)
    assert np.allclose(np.abs(rectangle), [(array.half_width, array.half_height, array.distance)] * 4)
    zone = overlay.viewing_zone(array, MINI)
    assert np.abs(zone[:, 0]).max() == pytest.approx(MINI.views[0] * array.spacing / 2)
