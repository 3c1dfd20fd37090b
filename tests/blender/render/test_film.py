"""A transparent film shows what Blender's own camera shows."""

import bpy
import numpy as np
import pytest

from blender_addon import compat
from blender_addon.render.cycles import RenderSettings, cycles_settings
from blender_addon.render.frame_folder import render_job
from blender_addon.render.output import render_to
from lfsr_core.images.exr import read_layers
from tests.support.requests import make_request
from tests.support.scenes import MINI, add_box, add_camera

SAMPLES = 32


@pytest.fixture
def pane(scene):
    """A clear pane of glass in an even grey world, in front of nothing."""
    glass = bpy.data.materials.new("glass")
    compat.use_nodes(glass)
    tree = glass.node_tree
    shader = tree.nodes.new("ShaderNodeBsdfGlass")
    shader.inputs["Roughness"].default_value = 0.0
    tree.links.new(shader.outputs[0], next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL").inputs[0])
    add_box(scene, (0, 0, 0), (0.5, 0.05, 0.5), glass)
    scene.world = bpy.data.worlds.new("grey")
    background = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (0.5, 0.5, 0.5, 1)
    add_camera(scene, (0, -4, 0), 0.3)
    scene.render.film_transparent = True
    return scene


def blenders_own(scene, path):
    """Colour (RGBA) of the pane's middle as Blender's camera renders it."""
    settings = RenderSettings(SAMPLES, transparent_glass=scene.cycles.film_transparent_glass)
    with cycles_settings(scene, settings, (32, 24)):
        render_to(scene, path)
    return read_layers(path)["color"][10:14, 14:18].mean((0, 1))


@pytest.mark.parametrize("layout", ["one-pass", "lens-card"])
@pytest.mark.parametrize("through", [False, True])
def test_glass_is_as_transparent_as_in_blenders_render(pane, tmp_path, layout, through):
    pane.cycles.film_transparent_glass = through
    render_job(pane, make_request(str(tmp_path / "out"), MINI, samples=SAMPLES, scale=4, layout=layout))
    color = read_layers(tmp_path / "out" / "lr_eia.exr")["color"]
    middle = color[9:15, 13:19].mean((0, 1))
    assert middle == pytest.approx(blenders_own(pane, tmp_path / "own.exr"), abs=0.02)
    assert (middle[3] < 0.2) == through


def test_glass_before_a_visible_world_is_opaque(pane, tmp_path):
    pane.cycles.film_transparent_glass = True
    render_job(pane, make_request(str(tmp_path / "out"), MINI, samples=SAMPLES, scale=4, world_visible=True))
    color = read_layers(tmp_path / "out" / "lr_eia.exr")["color"]
    assert color[9:15, 13:19, 3] == pytest.approx(1)
    assert np.isfinite(color).all()
