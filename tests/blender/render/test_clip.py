"""What the scene's camera clips is not in the image, with every kind of camera."""

import mathutils
import numpy as np
import pytest

from blender_addon.render import cycles
from blender_addon.render import view_by_view as views
from lfsr_core.images import exr
from lfsr_core.optics.rays import RayLayout
from tests.support.scenes import ARRAY, MINI, WAYS, add_box, add_plane, emission, front

LAYOUT = RayLayout.for_display(MINI, ARRAY, 4)


def rendered(scene, folder, way, clip):
    shot = cycles.Shot(LAYOUT, front(), way, clip)
    render = views.render_views if way == "view-by-view" else cycles.render_encoded
    render(scene, shot, cycles.RenderSettings(4, layers=("position",)), folder / "image.exr")
    layers = exr.read_layers(folder / "image.exr")
    return layers["color"], layers["position"]


@pytest.mark.parametrize("way", [*WAYS, "view-by-view"])
def test_things_before_and_behind_the_clipped_depths_are_not_seen(scene, tmp_path, way):
    upright = mathutils.Matrix.Rotation(np.pi / 2, 4, "X")
    near = 0.3 * ARRAY.distance
    # Cycles clips by the ray through a lens's centre, and the apertures of this display are wide.
    start = near * (1.5 if way == "view-by-view" else 1.01)
    add_plane(scene, mathutils.Matrix.Translation((0, near - ARRAY.distance, 0)) @ upright, emission((1, 0, 0)))
    add_box(scene, (0, 0, 0), (0.3, 0.01, 0.3), emission((0, 1, 0)))
    add_plane(scene, mathutils.Matrix.Translation((0, 3 * ARRAY.distance, 0)) @ upright, emission((0, 0, 1)))
    color, _ = rendered(scene, tmp_path, way, None)
    assert color[..., 0].min() > 0.99, "the wall hides everything"
    color, _ = rendered(scene, tmp_path, way, (start, 10 * ARRAY.distance))
    assert color[..., 0].max() == 0 and color[..., 1].max() > 0.99 and color[..., 2].max() > 0.99
    color, position = rendered(scene, tmp_path, way, (start, 2 * ARRAY.distance))
    assert color[..., 0].max() == 0 and color[..., 1].max() > 0.99
    assert color[..., 2].max() == 0 and (color[..., 3] == 0).any(), "nothing is seen where only the far wall is"
    assert not position[color[..., 3] == 0].any()
