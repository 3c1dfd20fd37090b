"""Scenes of the animations: what moves is what their names say."""

from pathlib import Path

import bpy
import pytest

from lfsr_core.optics.display import DisplayProfile
from lfsr_lab.experiments.animations.study import NAMES
from tests.support.prerequisites import needs_bpy

pytestmark = needs_bpy
SCRIPTS = Path(__file__).parents[3] / "scripts" / "lab" / "lfsr_lab" / "scenes"
DISPLAY = DisplayProfile("tiny", (64, 48), (59.04, 44.28), (8, 6), (8, 8), 500.0, 40.0)
MOVING = {"object": "ball", "light": "lamp", "dance": "dancer"}


@pytest.mark.parametrize("name", NAMES)
def test_one_thing_moves_and_nothing_else(monkeypatch, name):
    monkeypatch.syspath_prepend(str(SCRIPTS))
    import animation_scenes

    from lfsr_lab.scenes.sweeps.stage import Stage

    assert set(animation_scenes.BUILDERS) == set(NAMES)
    animation_scenes.BUILDERS[name](Stage.empty(DISPLAY, 4, 4), 0.0)
    scene = bpy.context.scene
    places = []
    for frame in (1, 4):
        scene.frame_set(frame)
        places.append({item.name: item.matrix_world.copy() for item in scene.objects if item.parent is None})
    moved = {item for item, place in places[0].items() if place != places[1][item]}
    assert moved == {MOVING.get(name, scene.camera.name)}
    assert (scene.frame_start, scene.frame_end) == (1, 4) and len(scene.objects) > 5
