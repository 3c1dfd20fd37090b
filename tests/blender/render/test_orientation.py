"""A scene without symmetry: nothing mirrored, nothing upside down, the near thing in front."""

from __future__ import annotations

import numpy as np
import pytest

from blender_addon.render import cycles, view_by_view
from lfsr_core.images import exr
from lfsr_core.optics import eia
from lfsr_core.optics.rays import RayLayout
from tests.support.scenes import ARRAY, MINI, add_box, emission, front

RED, GREEN, BLUE, YELLOW = (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0)
WAYS = {"one-pass": cycles.render_encoded, "lens-card": cycles.render_encoded,
        "view-by-view": view_by_view.render_views}


@pytest.fixture(params=list(WAYS))
def image(request, scene, tmp_path):
    """EIA of a red box top left and a green one right, both on the display plane, blue before yellow below."""
    add_box(scene, (-0.6, 0, 0.45), (0.15, 0.02, 0.15), emission(RED))
    add_box(scene, (0.6, 0, 0.0), (0.15, 0.02, 0.15), emission(GREEN))
    add_box(scene, (0, -0.8, -0.3), (0.1, 0.02, 0.1), emission(BLUE))
    add_box(scene, (0, 0.8, -0.45), (0.6, 0.02, 0.3), emission(YELLOW))
    layout = RayLayout.for_display(MINI, ARRAY)
    shot = cycles.Shot(layout, front(), request.param)
    WAYS[request.param](scene, shot, cycles.RenderSettings(32), tmp_path / "image.exr")
    return exr.read_layers(tmp_path / "image.exr")["color"][..., :3]


def where(view, color):
    """(right, down) centre of ``color`` in a view (sy, sx, 3), in lenses."""
    weight = np.clip(1 - np.abs(view - color).sum(-1), 0, None)
    assert weight.sum() > 0.3, f"{color} is not seen"
    rows, columns = np.indices(weight.shape)
    return np.array([(columns * weight).sum(), (rows * weight).sum()]) / weight.sum()


def test_places_in_the_central_view(image):
    view = eia.to_views(image, MINI.lenses)[4, 4]
    centre = (np.array(MINI.lenses) - 1) / 2
    red, green = where(view, RED) - centre, where(view, GREEN) - centre
    assert red[0] < -3 and red[1] < -2, "red is up left"
    assert green[0] > 3 and abs(green[1]) < 1, "green is right, half way up"


def test_display_plane_does_not_move_between_views(image):
    every = eia.to_views(image, MINI.lenses)
    places = np.array([where(every[row, column], RED) for row in (0, 7) for column in (0, 7)])
    assert np.ptp(places, axis=0).max() < 0.3


def test_near_moves_against_the_camera_and_far_with_it(image):
    every = eia.to_views(image, MINI.lenses)
    for axis, (first, last) in enumerate((((4, 0), (4, 7)), ((0, 4), (7, 4)))):
        near = where(every[last], BLUE) - where(every[first], BLUE)
        assert near[axis] < -2 and abs(near[1 - axis]) < 0.5, "camera right and down: near thing left and up"
    left, right = (np.clip(1 - np.abs(every[4, k] - YELLOW).sum(-1), 0, 1) for k in (0, 7))
    columns = np.arange(MINI.lenses[0])
    edges = [columns[weight.sum(0) > 0.5] for weight in (left, right)]
    assert edges[1].max() > edges[0].max() and edges[1].min() > edges[0].min(), "camera right: far thing right"


def test_near_hides_far(image):
    every = eia.to_views(image, MINI.lenses)
    for row, column in ((4, 4), (0, 3), (5, 6)):
        right, down = np.round(where(every[row, column], BLUE)).astype(int)
        assert every[row, column, down, right] == pytest.approx(BLUE, abs=0.3)


def test_elemental_image_looks_from_left_to_right(image):
    """What is nearer than the display lies between a lens right of it and a camera left of it."""
    elemental = eia.to_elemental_images(image, MINI.lenses)
    blue = np.clip(1 - np.abs(elemental - BLUE).sum(-1), 0, 1).sum((0, 2))   # (sx, px)
    seen = [np.average(np.arange(8), weights=row) for row in blue if row.sum() > 0.3]
    assert len(seen) >= 4 and np.all(np.diff(seen) < 0.2) and seen[0] - seen[-1] > 2
