"""Light and the camera of generated scenes."""

from __future__ import annotations

import math

import bpy
import mathutils

from blender_addon.scene.light import add_light
from lfsr_lab.scenes.shared.objects import Graph, add_object

CAMERA_DISTANCE, DISPLAY_WIDTH = 10.0, 7.084  # of the 32-inch display, in units of 10 cm
Vector = tuple[float, float, float]


def demo_camera() -> None:
    """Make an empty scene for Cycles with a camera at the viewing position of the 32-inch display.

    One unit is 10 cm: the camera looks along +Y from 1 m and focuses on the display plane, y = 0, which reaches from
    -3.5 to 3.5 in x and -2 to 2 in z.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine, scene.render.film_transparent = "CYCLES", True
    camera = bpy.data.cameras.new("Camera")
    camera.sensor_fit, camera.angle = "HORIZONTAL", 2 * math.atan(DISPLAY_WIDTH / 2 / CAMERA_DISTANCE)
    camera.dof.use_dof, camera.dof.focus_distance = True, CAMERA_DISTANCE
    scene.camera = add_object(camera, None, "Camera")
    scene.camera.location, scene.camera.rotation_euler = (0, -CAMERA_DISTANCE, 0), (math.pi / 2, 0, 0)


def world(image: str = "city", strength: float = 0.45) -> bpy.types.Node:
    """Light the scene with one of Blender's own world images, packed; return the background node."""
    graph = Graph(add_light(bpy.context.scene, image).node_tree)
    graph.only("TEX_ENVIRONMENT").image.pack()
    background = graph.only("BACKGROUND")
    background.inputs["Strength"].default_value = strength
    return background


def sun(strength: float = 1.2, angle: float = 0.1, turn: Vector = (0.7, 0.0, -0.6)) -> None:
    """Add a sun ``angle`` radians across, turned by Euler angles: from the upper left of the viewer."""
    data = bpy.data.lights.new("sun", "SUN")
    data.energy, data.angle = strength, angle
    add_object(data, None, "sun").rotation_euler = turn


def lamp(at: Vector, watts: float, size: float, color: Vector = (1, 1, 1)) -> bpy.types.Object:
    """Add a square lamp that looks at the middle of the display."""
    data = bpy.data.lights.new("lamp", "AREA")
    data.energy, data.size, data.color = watts, size, color
    thing = add_object(data, None, "lamp")
    aim(thing, at)
    return thing


def aim(thing: bpy.types.Object, at: Vector) -> None:
    """Place a lamp so that it looks at the middle of the display."""
    thing.location = at
    thing.rotation_euler = (-mathutils.Vector(at)).to_track_quat("-Z", "Y").to_euler()
