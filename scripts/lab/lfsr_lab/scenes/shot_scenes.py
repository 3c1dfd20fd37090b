"""Small animations in which one thing changes: run inside Blender with a JSON file as last argument.

    python scripts/lab/lfsr_lab/scenes/shot_scenes.py SHOTS.json

The file holds "display" (a profile), "scale", "frames" and "scenes": objects of "name" (of SHOTS) and "path".
`python -m lfsr_lab.experiments.animations` writes it. World axes and lengths as of stress/stage.py.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

# Where lfsr_lab and lfsr_core are: installed side by side, or in a clone, scripts/lab and the root.
sys.path.extend(str(Path(__file__).resolve().parents[level]) for level in (2, 4))

import bpy
import mathutils

from lfsr_core.optics.display import DisplayProfile
from lfsr_core.render.protocol import emit
from lfsr_lab.scenes.shared import surfaces
from lfsr_lab.scenes.shared.objects import add_object
from lfsr_lab.scenes.shared.script import leave, run, save
from lfsr_lab.scenes.stress.dials import full_board
from lfsr_lab.scenes.stress.stage import Stage, board, put, turned, world_light
from lfsr_lab.scenes.stress.things import Grid, bodies, every_sort, printed

FILL, LAMP_POWER, LAMP_SIZE = 0.12, 9.0, 8.0  # lamp: watts per squared pitch of its distance, pitches
BODY_SIZE = 1.6  # of the bodies, besides that of the stability suite
BALL_STEP, LAMP_STEP, ARRAY_STEP = 0.9, math.radians(8), 0.4  # of a frame: pitches, radians, pitches


def room(stage: Stage) -> bpy.types.Object:
    """A printed wall, a glossy printed ground, bodies of every sort and an area light, which is returned."""
    world_light(strength=FILL)
    space = stage.space
    y, (width, height) = space.depth(0.9), space.window(space.depth(0.9))
    full_board(stage, "wall", y, printed("wallpaper", 0.5))
    ground = board("ground", 0.0, (1.3 * width, height), printed("carpet", 0.8, Roughness=0.25, Specular_IOR_Level=0.6))
    ground.location = (0.0, 0.0, -0.42 * space.lenses[1])
    turned(ground, (-80, 0, 0))
    for body in bodies(stage, space.depth(-0.3), space.depth(0.5), every_sort(), Grid(4.0, (9.0, 3.0))):
        body.scale *= BODY_SIZE
    return lamp(stage)


def lamp(stage: Stage) -> bpy.types.Object:
    """An area light at the upper left, half way to the viewer."""
    data = bpy.data.lights.new("lamp", "AREA")
    data.size, data.energy = LAMP_SIZE, LAMP_POWER * stage.space.distance**2 / 4
    thing = add_object(data, None, "lamp")
    aim(thing, stage, -0.7)
    return thing


def aim(thing: bpy.types.Object, stage: Stage, angle: float) -> None:
    """Put the lamp ``angle`` radians right of the middle, looking at it."""
    away = 0.5 * stage.space.distance
    thing.location = (away * math.sin(angle), -away * math.cos(angle), 0.6 * away)
    thing.rotation_euler = (-mathutils.Vector(thing.location)).to_track_quat("-Z", "Y").to_euler()


def moving_object(stage: Stage) -> None:
    """A printed ball crosses before the others."""
    room(stage)
    ball = put("ball", surfaces.sphere(), printed("ball", 1.5, Roughness=0.3, Specular_IOR_Level=0.5), (0, 0, 0), 1.7)
    for frame in each(stage):
        ball.location = ((frame - (stage.frames + 1) / 2) * BALL_STEP, stage.space.depth(-0.4), -0.8)
        ball.rotation_euler = (0.0, frame * BALL_STEP / 1.7, 0.0)
        keep(ball, frame)


def moving_light(stage: Stage) -> None:
    """The area light goes from left to right."""
    thing = room(stage)
    for frame in each(stage):
        aim(thing, stage, -0.7 + (frame - 1) * LAMP_STEP)
        keep(thing, frame)


def moving_array(stage: Stage) -> None:
    """The camera array goes sideways, its display plane with it."""
    room(stage)
    array = bpy.context.scene.camera
    start = array.location.x
    for frame in each(stage):
        array.location.x = start + (frame - (stage.frames + 1) / 2) * ARRAY_STEP
        keep(array, frame)


def each(stage: Stage) -> range:
    """The numbers of the frames."""
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, stage.frames
    return range(1, stage.frames + 1)


def keep(thing: bpy.types.Object, frame: int) -> None:
    """A keyframe of where ``thing`` stands now."""
    thing.keyframe_insert("location", frame=frame)
    thing.keyframe_insert("rotation_euler", frame=frame)


SHOTS: dict[str, Callable[[Stage], None]] = {"object": moving_object, "light": moving_light, "array": moving_array}


def build(data: dict[str, Any]) -> None:
    """Write every scene of a job."""
    profile = DisplayProfile.from_dict(data["display"])
    for number, entry in enumerate(data["scenes"]):
        emit(stage="scene", fraction=number / len(data["scenes"]), message=entry["name"])
        SHOTS[entry["name"]](Stage.empty(profile, data["scale"], data["frames"]))
        bpy.context.scene.frame_set(1)
        save(Path(entry["path"]))


if __name__ == "__main__":
    leave(run(build, "a list of shots"))
