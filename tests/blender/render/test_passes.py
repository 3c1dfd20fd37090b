"""The passes of a render against Blender's own image."""

import bpy
import pytest

from blender_addon.render import cycles, frame_folder, output
from lfsr_core.images import exr
from tests.support.requests import make_request
from tests.support.scenes import MINI, WAYS, add_box


@pytest.mark.parametrize("way", WAYS)
def test_color_and_environment_add_up_to_blenders_own_image(scene, tmp_path, way):
    """The environment layer is already weighted by what is left uncovered."""
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    scene.world = bpy.data.worlds.new("world")
    scene.world.color = (0.3, 0.6, 0.9)
    job = make_request(str(tmp_path), MINI, samples=64)
    with frame_folder.prepared(scene, job) as frame:
        assert frame.world_visible, "a world that Blender would show is shown"
        settings = cycles.RenderSettings(64, world_visible=True)
        with (cycles.encoded_camera(scene, cycles.Shot(frame.rays, frame.matrix_world, way)),
              cycles.cycles_settings(scene, settings, frame.rays.size)):
            output.render_to(scene, tmp_path / "apart.exr")
            scene.render.film_transparent = False
            output.render_to(scene, tmp_path / "whole.exr")
    apart, whole = (exr.read_layers(tmp_path / f"{name}.exr") for name in ("apart", "whole"))
    partly = (apart["color"][..., 3] > 0.1) & (apart["color"][..., 3] < 0.9)
    assert partly.sum() > 10, "edges are what could go wrong"
    assert apart["color"][..., :3] + apart["environment"] == pytest.approx(whole["color"][..., :3], abs=2e-3)
