"""A scene whose every layer has something."""

import bpy
import pytest

from tests.support.scenes import add_box, add_camera, add_lamp, emission


@pytest.fixture
def lit(scene):
    """A wall that fills the view and a box that shines before it, in noisy light, shadow and a world."""
    add_box(scene, (0, 1, 0), (5, 0.1, 5))
    add_box(scene, (0, 0, 0.2), (0.4, 0.3, 0.3), emission((0.2, 0.6, 0.1))).name = "box"
    add_lamp(scene)
    scene.world = bpy.data.worlds.new("world")
    add_camera(scene, (0, -3, 0), 0.9)
    return scene
