"""The scenes kept out of all tuning: each builds, again the same, around the display plane of its camera."""

from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Vector

from tests.support.prerequisites import needs_bpy

pytestmark = needs_bpy
SCRIPTS = Path(__file__).parents[3] / "scripts" / "lab" / "lfsr_lab" / "scenes"
NAMES = ("glitter", "cloth", "room", "city", "deep", "world")


@pytest.fixture
def built(monkeypatch):
    """Function that builds one of the scenes in this Blender."""
    monkeypatch.syspath_prepend(str(SCRIPTS))
    import unseen_scenes

    assert tuple(unseen_scenes.BUILDERS) == NAMES

    def build(name):
        unseen_scenes.demo_camera()
        unseen_scenes.BUILDERS[name](np.random.default_rng(5))
        bpy.context.view_layer.update()
        return bpy.context.scene

    return build


def corners(scene):
    """Bounding boxes of all meshes in world space, (n, 8, 3)."""
    return np.array([[item.matrix_world @ Vector(corner) for corner in item.bound_box]
                     for item in scene.objects if item.type == "MESH"])


@pytest.mark.parametrize("name", NAMES)
def test_scene_stands_before_its_camera_and_is_lit(built, name):
    scene = built(name)
    places = corners(scene)
    middle = places.mean(1)
    assert np.isfinite(places).all() and (places[..., 1] > scene.camera.location.y).all()
    assert (np.abs(middle[:, [0, 2]]) < (4.5, 2.6)).all(), "a thing beside the display"
    assert scene.world.node_tree.nodes and scene.render.film_transparent == (name != "world")
    assert np.ptp(middle[:, 1]) > (4 if name in ("deep", "city") else 0.5)


def test_the_same_numbers_give_the_same_scene(built):
    np.testing.assert_array_equal(corners(built("city")), corners(built("city")))
