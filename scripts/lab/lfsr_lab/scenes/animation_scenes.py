"""Small animations in which one thing moves: run inside Blender with a JSON file as last argument.

    python scripts/lab/lfsr_lab/scenes/animation_scenes.py SCENES.json

`python -m lfsr_lab.experiments.animations` writes the file, see ``write_scenes``.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

# Where lfsr_lab and lfsr_core are: installed side by side, or in a clone, scripts/lab and the root.
sys.path.extend(str(Path(__file__).resolve().parents[level]) for level in (2, 4))

import bpy

from lfsr_lab.scenes.shared import surfaces
from lfsr_lab.scenes.shared.light import aim, lamp, world
from lfsr_lab.scenes.shared.objects import put
from lfsr_lab.scenes.sweeps.builders import full_board
from lfsr_lab.scenes.sweeps.stage import Stage, board, turned, write_scenes
from lfsr_lab.scenes.sweeps.things import Grid, bodies, every_sort, printed

FILL, LAMP_POWER, LAMP_SIZE = 0.12, 9.0, 8.0  # lamp: watts per squared pitch of its distance, pitches
BODY_SIZE = 1.6  # of the bodies, times that of the sweeps
BALL_STEP, LAMP_STEP, ARRAY_STEP = 0.9, math.radians(8), 0.4  # of a frame: pitches, radians, pitches


def room(stage: Stage) -> bpy.types.Object:
    """A printed wall, a glossy printed ground, bodies of every sort and an area light, which is returned."""
    world(strength=FILL)
    space = stage.space
    y, (width, height) = space.depth(0.9), space.window(space.depth(0.9))
    full_board(stage, "wall", y, printed("wallpaper", 0.5))
    ground = board("ground", 0.0, (1.3 * width, height), printed("carpet", 0.8, Roughness=0.25, Specular_IOR_Level=0.6))
    ground.location = (0.0, 0.0, -0.42 * space.lenses[1])
    turned(ground, (-80, 0, 0))
    for body in bodies(stage, space.depth(-0.3), space.depth(0.5), every_sort(), Grid(4.0, (9.0, 3.0))):
        body.scale *= BODY_SIZE
    return lamp(lamp_place(stage, -0.7), LAMP_POWER * space.distance**2 / 4, LAMP_SIZE)


def lamp_place(stage: Stage, angle: float) -> tuple[float, float, float]:
    """Return a place half way to the viewer, ``angle`` radians right of the middle."""
    away = 0.5 * stage.space.distance
    return away * math.sin(angle), -away * math.cos(angle), 0.6 * away


def moving_object(stage: Stage, _value: float) -> None:
    """A printed ball crosses before the others."""
    room(stage)
    material = printed("ball", 1.5, Roughness=0.3, Specular_IOR_Level=0.5)
    ball = put(surfaces.sphere(), material, (0, 0, 0), 1.7, name="ball")
    for frame in frames_of(stage):
        ball.location = ((frame - (stage.frames + 1) / 2) * BALL_STEP, stage.space.depth(-0.4), -0.8)
        ball.rotation_euler = (0.0, frame * BALL_STEP / 1.7, 0.0)
        keyframe(ball, frame)


def moving_light(stage: Stage, _value: float) -> None:
    """The area light goes from left to right."""
    thing = room(stage)
    for frame in frames_of(stage):
        aim(thing, lamp_place(stage, -0.7 + (frame - 1) * LAMP_STEP))
        keyframe(thing, frame)


def moving_array(stage: Stage, _value: float) -> None:
    """The camera array goes sideways, its display plane with it."""
    room(stage)
    array = bpy.context.scene.camera
    start = array.location.x
    for frame in frames_of(stage):
        array.location.x = start + (frame - (stage.frames + 1) / 2) * ARRAY_STEP
        keyframe(array, frame)


def frames_of(stage: Stage) -> range:
    """The numbers of the frames."""
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, stage.frames
    return range(1, stage.frames + 1)


def keyframe(thing: bpy.types.Object, frame: int) -> None:
    """Insert a keyframe of where ``thing`` stands now."""
    thing.keyframe_insert("location", frame=frame)
    thing.keyframe_insert("rotation_euler", frame=frame)


BUILDERS = {"object": moving_object, "light": moving_light, "array": moving_array}


if __name__ == "__main__":
    write_scenes(BUILDERS)
