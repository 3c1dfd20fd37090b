"""The passes of a render against Blender's own image."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from blender_addon.render import cycles, frame_folder, output
from blender_addon.render.view_by_view import render_views
from lfsr_core.errors import LfsrError
from lfsr_core.frames.job import Job
from lfsr_core.images import exr
from lfsr_core.optics.rays import RayLayout
from lfsr_core.reconstruct.methods.denoise import denoise_eia
from tests.support.scenes import ARRAY, MINI, WAYS, add_box, encoded, front


@pytest.mark.parametrize("way", WAYS)
def test_color_and_environment_add_up_to_blenders_own_image(scene, tmp_path, way):
    """The environment layer is already weighted by what is left uncovered."""
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    scene.world = bpy.data.worlds.new("world")
    scene.world.color = (0.3, 0.6, 0.9)
    job = Job(str(tmp_path), MINI, spp=64)
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


@pytest.mark.parametrize("way", WAYS)
def test_denoised_layer_is_open_image_denoises(scene, tmp_path, way):
    """Colour stays as rendered; beside it stands what the method oidn makes of it."""
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    scene.world = bpy.data.worlds.new("world")
    layout = RayLayout.for_display(MINI, ARRAY, 2)
    noisy = encoded(scene, layout, tmp_path, way=way, samples=2, layers=("albedo",))
    both = encoded(scene, layout, tmp_path, way=way, samples=2, layers=("albedo", "denoised", "position"))
    assert (both["color"] == noisy["color"]).all()
    assert set(both) - set(noisy) == {"denoised", "position"}
    # Cycles' rows go up, and the library's network sees the difference.
    expected = denoise_eia(noisy["color"][::-1, :, :3])[::-1]
    taken = np.abs(expected - noisy["color"][..., :3]).mean()
    assert taken > 1e-3, "there is noise to take away"
    assert np.abs(both["denoised"] - expected).mean() < 0.01 * taken


def test_views_are_not_denoised_one_by_one(scene, tmp_path):
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    shot = cycles.Shot(RayLayout.for_display(MINI, ARRAY, 4), front())
    with pytest.raises(LfsrError, match="view by view, which loses detail"):
        render_views(scene, shot, cycles.RenderSettings(1, layers=("denoised",)), tmp_path / "views.exr")
