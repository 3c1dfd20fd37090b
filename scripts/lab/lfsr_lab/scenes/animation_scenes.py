"""Small animations in which one thing moves: run inside Blender with a JSON file as last argument.

    python scripts/lab/lfsr_lab/scenes/animation_scenes.py SCENES.json

`lfsr study animations` writes the file, see ``write_scenes``.
"""

import functools
import math
import sys
from collections.abc import Callable
from pathlib import Path

# Where lfsr_lab and lfsr_core are: installed side by side, or in a clone, scripts/lab and the root.
sys.path.extend(str(Path(__file__).resolve().parents[level]) for level in (2, 4))

import bpy
import numpy as np

from lfsr_lab.scenes.shared import surfaces
from lfsr_lab.scenes.shared.objects import add_object, aim, lamp, paint, put, world
from lfsr_lab.scenes.sweeps.builders import Grid, bodies, every_sort, full_board, printed
from lfsr_lab.scenes.sweeps.stage import Stage, board, turned, write_scenes

FILL, LAMP_POWER, LAMP_SIZE = 0.12, 9.0, 8.0  # lamp: watts per squared pitch of its distance, pitches
BODY_SIZE = 1.6  # of the bodies, times that of the sweeps
BEAT = 16  # frames, of the dance
BALL_STEP, ARRAY_STEP, BALL_TURN, LAMP_STEP = 0.9, 0.4, 0.1, math.radians(8)  # of a frame: pitches; radians


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


def moving_object(stage: Stage, _value: float, step: float = BALL_STEP) -> None:
    """A printed ball crosses before the others; with a ``step`` of 0 a large one turns, as on a turntable."""
    room(stage)
    print_ = printed("ball", 1.5, Roughness=0.3, Specular_IOR_Level=0.5)
    ball = put(surfaces.sphere(), print_, (0, 0, 0), 1.7 if step else 5.0, name="ball")
    for frame in frames_of(stage):
        ball.location = ((frame - (stage.frames + 1) / 2) * step, stage.space.depth(-0.4), -0.8)
        ball.rotation_euler = (0.0, frame * step / 1.7, 0.0 if step else frame * BALL_TURN)
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


def dancing_figure(stage: Stage, _value: float) -> None:
    """A figure dances before nothing, as fast as people do."""
    world(strength=0.6)
    lamp(lamp_place(stage, -0.5), LAMP_POWER * stage.space.distance**2 / 4, LAMP_SIZE)
    cloth, skin = printed("cloth", 2.5, Roughness=0.6), paint("skin", (0.6, 0.35, 0.25), 0.5)
    dancer = add_object(None, None, "dancer")
    put(surfaces.sphere(), cloth, (0, 0, 0), (1.1, 0.9, 1.7)).parent = dancer
    put(surfaces.sphere(), skin, (0, 0, 2.5), 0.8).parent = dancer
    sides = (-1, 1)
    arms = [limb(dancer, skin, (side * 1.1, 0, 1.2), 0.35) for side in sides]
    hands = [limb(arm, skin, (0, 0, -2), 0.28) for arm in arms]
    legs = [limb(dancer, cloth, (side * 0.6, 0, -1.3), 0.5) for side in sides]
    feet = [limb(leg, cloth, (0, 0, -2), 0.35) for leg in legs]
    for frame in frames_of(stage):
        turn = frame * 2 * math.pi / BEAT
        dancer.location = (2.2 * math.sin(turn / 2), stage.space.depth(-0.2), 0.4 * abs(math.sin(turn)))
        dancer.rotation_euler = (0, 0.25 * math.sin(turn), 0.9 * math.sin(turn / 2))
        for index, side in enumerate(sides):
            swing = math.sin(turn + 3 * index)
            arms[index].rotation_euler = (0.6 * swing, side * (math.sin(turn + index) - 1.2), 0)
            hands[index].rotation_euler = (0.7 * math.sin(1.3 * turn), -0.5 * side * (1 + swing), 0)
            legs[index].rotation_euler = (0.5 * swing, -0.35 * side, 0)
            feet[index].rotation_euler = (0.5 * (1 + swing), 0, 0)
        for thing in (dancer, *arms, *hands, *legs, *feet):
            keyframe(thing, frame)


def limb(parent: bpy.types.Object, material: bpy.types.Material, at: tuple[float, float, float],
         radius: float) -> bpy.types.Object:
    """Part of a figure, two pitches long, that hangs from ``at``."""
    path = np.stack([np.zeros(12), np.zeros(12), np.linspace(0, -2, 12)], -1)
    (thing := put(surfaces.tube(path, radius, 16), material, at)).parent = parent
    return thing


def frames_of(stage: Stage) -> range:
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, stage.frames
    return range(1, stage.frames + 1)


def keyframe(thing: bpy.types.Object, frame: int) -> None:
    """Insert a keyframe of where ``thing`` stands now."""
    thing.keyframe_insert("location", frame=frame)
    thing.keyframe_insert("rotation_euler", frame=frame)


BUILDERS: dict[str, Callable[[Stage, float], None]] = {
    "object": moving_object, "turn": functools.partial(moving_object, step=0.0), "light": moving_light,
    "dance": dancing_figure, "array": moving_array}


if __name__ == "__main__":
    write_scenes(BUILDERS)
