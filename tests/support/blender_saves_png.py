"""Run by test_color.py in a process of its own: Blender saves FOLDER/linear.npy once per entry of cases.json."""

import json
import sys
from pathlib import Path

import bpy
import numpy as np

folder = Path(sys.argv[-1])
linear = np.load(folder / "linear.npy")
height, width, _ = linear.shape
image = bpy.data.images.new("linear", width, height, alpha=True, float_buffer=True)
pixels = np.ones((height, width, 4), np.float32)
pixels[..., :3] = linear[::-1]
image.pixels.foreach_set(pixels.ravel())
scene = bpy.context.scene
scene.render.dither_intensity = 0
settings = scene.render.image_settings
settings.file_format, settings.color_mode, settings.color_depth = "PNG", "RGB", "8"
for index, case in enumerate(json.loads((folder / "cases.json").read_text())):
    scene.display_settings.display_device = case["display_device"]
    view = scene.view_settings
    view.view_transform, view.look = case["view_transform"], case["look"]
    view.exposure, view.gamma = case["exposure"], case["gamma"]
    image.save_render(str(folder / f"{index}.png"), scene=scene)
