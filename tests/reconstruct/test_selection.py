"""Which lenses the method makes, and what stands in the others: background, world, meshes of the background."""

import dataclasses

import numpy as np
import pytest

from lfsr_core.frames import low_res
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.frame import LOW_RES_FILE, read_frame
from lfsr_core.images.exr import read_layers, write_layers
from lfsr_core.images.png import read_mask, read_png
from lfsr_core.optics import eia
from lfsr_core.pipeline.make import finish_frame
from lfsr_core.reconstruct import second_stage
from tests.support.prerequisites import needs_bpy
from tests.support.slow_way import expected_linear
from tests.support.synthetic import MINI, light_field, write_render
from tests.support.told import refuses

pytestmark = needs_bpy  # for Blender's colour configuration


def test_display_background_shows_around_and_through(tmp_path):
    green = dataclasses.replace(MINI, background=(0.0, 0.5, 0.0))
    write_render(tmp_path, scale=1, display=green)
    truth = light_field()
    expected = truth[..., :3] + (1 - truth[..., 3:]) * np.float32([0, 0.5, 0])
    np.testing.assert_allclose(second_stage.finished_linear(tmp_path, "none"), expected, atol=1e-6)
    finish_frame(tmp_path, "none")
    np.testing.assert_array_equal(read_png(tmp_path / "eia.png")[0, 0], [0, 188, 0])


def test_visible_world_fills_the_background_lenses(tmp_path):
    """Cycles weighs the environment by what shows of it: it is added, never weighted twice."""
    write_render(tmp_path, world_visible=True)
    color = read_layers(tmp_path / LOW_RES_FILE)["color"]
    sky = np.linspace(0.2, 0.9, color.shape[1])[None, :, None] * np.ones_like(color[..., :3])
    write_layers(tmp_path / LOW_RES_FILE, {"color": color, "environment": sky * (1 - color[..., 3:])})
    layers = read_layers(tmp_path / LOW_RES_FILE)
    low = low_res.over_background(layers, read_frame(tmp_path))
    np.testing.assert_allclose(low, color[..., :3] + sky * (1 - color[..., 3:]), atol=1e-6)
    result = eia.to_elemental_images(second_stage.finished_linear(tmp_path, "bicubic"), MINI.lenses)
    mask = np.asarray(eia.to_elemental_images(color[..., 3:], MINI.lenses).any((2, 3, 4)))
    assert 0 < mask.mean() < 1
    sky_lenses = eia.to_elemental_images(sky, MINI.lenses)
    np.testing.assert_allclose(result[~mask].mean((1, 2)), sky_lenses[~mask].mean((1, 2)), atol=2e-3)


def test_visible_world_without_its_layer_is_an_error(tmp_path):
    write_render(tmp_path, world_visible=True)
    refuses("no environment layer", finish_frame, tmp_path, "bicubic")
    assert not (tmp_path / "eia.png").exists()


def test_background_meshes_are_filled_cheaply_and_objects_by_the_method(tmp_path):
    write_render(tmp_path)
    color = read_layers(tmp_path / LOW_RES_FILE)["color"]
    color[..., 3] = 1
    color[..., :3] += 0.3
    index = np.full_like(color[..., :1], 2)
    index[:8, :8] = 1  # lenses (0..1, 0..1)
    write_layers(tmp_path / LOW_RES_FILE, {"color": color, "index": index})
    result, method_, cheap = (eia.to_elemental_images(x, MINI.lenses) for x in (
        second_stage.finished_linear(tmp_path, "nearest"), expected_linear(tmp_path, "nearest"),
        expected_linear(tmp_path, second_stage.FILL_METHOD)))
    np.testing.assert_allclose(result[:2, :2], method_[:2, :2], atol=1e-6)
    np.testing.assert_allclose(result[2:], cheap[2:], atol=1e-6)
    np.testing.assert_allclose(result[:2, 2:], cheap[:2, 2:], atol=1e-6)


def test_mask_and_dilation_are_written(tmp_path):
    write_render(tmp_path)
    report = finish_frame(tmp_path, "bicubic")
    plain = read_mask(tmp_path / "mask.png")
    alpha = eia.to_elemental_images(read_layers(tmp_path / LOW_RES_FILE)["color"][..., 3:], MINI.lenses)
    np.testing.assert_array_equal(plain, alpha.any((2, 3, 4)))
    assert report.foreground_fraction == pytest.approx(plain.mean())
    assert finish_frame(tmp_path, Finish("bicubic", dilate=1)).foreground_fraction > plain.mean()
    assert (read_mask(tmp_path / "mask.png") >= plain).all()


def test_without_selection_every_lens_is_foreground(tmp_path):
    folder = write_render(tmp_path)
    linear, mask = second_stage.linear_and_mask(folder, "bicubic")
    whole, every = second_stage.linear_and_mask(folder, "bicubic", selection=False)
    assert every.all() and not mask.all()
    inside = np.repeat(np.repeat(mask, 8, 0), 8, 1)
    np.testing.assert_allclose(linear[inside], whole[inside], atol=1e-6)
