"""Direct subpixel rendering with Cycles, against the panel image that is woven from every view."""

import bpy
import numpy as np
import pytest

from blender_addon import compat
from blender_addon.render import frame_folder
from blender_addon.scene import devices
from lfsr_core.frames.frame import PANEL_FILE
from lfsr_core.images.png import read_png
from lfsr_core.pipeline.make import finish_frame
from tests.support.panels import cells, hexagonal, small
from tests.support.requests import make_request
from tests.support.scenes import add_box, add_camera


@pytest.fixture
def waves(scene):
    """Boxes that shine in waves, before and behind the display plane."""
    for place, half in (((-0.3, -0.3, 0), (0.5, 0.1, 0.3)), ((0.5, 0.4, 0.2), (0.4, 0.1, 0.5))):
        add_box(scene, place, half, _waves())
    add_camera(scene, (0, -4, 0), 0.7)
    return scene


def _waves():
    material = bpy.data.materials.new("waves")
    compat.use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    place, noise, shader, output = (tree.nodes.new(f"ShaderNode{name}") for name in (
        "NewGeometry", "TexNoise", "Emission", "OutputMaterial"))
    noise.inputs["Scale"].default_value = 2.0
    for source, target in ((place.outputs["Position"], noise.inputs["Vector"]), (
            noise.outputs["Color"], shader.inputs["Color"]), (shader.outputs[0], output.inputs["Surface"])):
        tree.links.new(source, target)
    return material


def panel(scene, folder, display, **options):
    frame_folder.render_job(scene, make_request(str(folder), display, **{"samples": 16, "scale": 1} | options))
    finish_frame(folder, "none")
    return read_png(folder / PANEL_FILE).astype(float)


def psnr(first, second):
    return -10 * np.log10((((first - second) / 255) ** 2).mean())


@pytest.mark.parametrize(("make", "world"), [(cells, False), (hexagonal, False), (cells, True)])
def test_it_is_the_image_that_is_woven_from_every_view(waves, tmp_path, monkeypatch, make, world):
    """Also without Open Shading Language."""
    display = small(make())
    if world:
        waves.world = bpy.data.worlds.new("world")
        waves.world.color = (0.1, 0.3, 0.7)
        monkeypatch.setattr(devices, "has_osl", lambda: False)
    direct = panel(waves, tmp_path / "direct", display, layout="subpixels", world_visible=world)
    woven = panel(waves, tmp_path / "woven", display, world_visible=world)
    # 24 to 29 dB: what interpolating costs, most of it at the edges of the boxes.
    assert direct.std() > 30 and psnr(direct, woven) > 22
    others = direct[:, ::-1], direct[::-1], np.roll(direct, 1, 1)
    assert max(psnr(other, woven) for other in others) < psnr(direct, woven) - 2, "this can tell"
