"""Which lenses the method makes, and what stands behind: background, world, meshes of the background."""

import dataclasses

import numpy as np
import pytest

from lfsr_core.frames import low_res
from lfsr_core.frames.frame import LOW_RES_FILE, WORLD_FILE, read_frame
from lfsr_core.frames.low_res import low_resolution, read_world
from lfsr_core.frames.request import Finish
from lfsr_core.images.exr import read_layers, write_layers
from lfsr_core.images.png import read_mask, read_png
from lfsr_core.optics import eia
from lfsr_core.optics.eia import to_elemental_images
from lfsr_core.pipeline.make import finish_frame
from lfsr_core.reconstruct import second_stage
from lfsr_core.reconstruct.methods import PLAIN_METHOD, load_method
from lfsr_core.reconstruct.second_stage import finished_lenses, finished_linear
from tests.support.prerequisites import needs_bpy
from tests.support.slow_way import expected_linear
from tests.support.synthetic import MINI, light_field, write_apart, write_render
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
        expected_linear(tmp_path, PLAIN_METHOD)))
    np.testing.assert_allclose(result[:2, :2], method_[:2, :2], atol=1e-6)
    np.testing.assert_allclose(result[2:], cheap[2:], atol=1e-6)
    np.testing.assert_allclose(result[:2, 2:], cheap[:2, 2:], atol=1e-6)
    every = second_stage.finished_linear(tmp_path, "nearest", selection=False)
    np.testing.assert_allclose(every, expected_linear(tmp_path, "nearest"), atol=1e-6)


def test_mask_and_dilation_are_written(tmp_path):
    write_render(tmp_path)
    report = finish_frame(tmp_path, "bicubic")
    plain = read_mask(tmp_path / "mask.png")
    alpha = eia.to_elemental_images(read_layers(tmp_path / LOW_RES_FILE)["color"][..., 3:], MINI.lenses)
    np.testing.assert_array_equal(plain, alpha.any((2, 3, 4)))
    assert report.foreground_fraction == pytest.approx(plain.mean())
    assert finish_frame(tmp_path, Finish("bicubic", dilate=1)).foreground_fraction > plain.mean()
    assert (read_mask(tmp_path / "mask.png") >= plain).all()


def whole_world(folder):
    frame = read_frame(folder)
    lenses = np.argwhere(np.ones(MINI.lenses[::-1], bool))
    return read_world(folder, frame).elemental_images(lenses).reshape(*MINI.lenses[::-1], 8, 8, 3)


@pytest.mark.parametrize("name", ["bilinear", "oidn+pool"])
def test_lenses_without_subject_see_the_world_alone(tmp_path, name):
    write_apart(tmp_path)
    result = to_elemental_images(finished_linear(tmp_path, name), MINI.lenses)
    alpha = to_elemental_images(read_layers(tmp_path / LOW_RES_FILE)["color"][..., 3:], MINI.lenses)
    empty = ~alpha.any((2, 3, 4))
    assert 0.1 < empty.mean() < 0.9
    # A denoiser leaves next to nothing where there was nothing.
    np.testing.assert_allclose(result[empty], whole_world(tmp_path)[empty], atol=1e-6 if name == "bilinear" else 2e-3)


def test_an_opaque_subject_hides_it(tmp_path):
    def opaque(color):
        return np.concatenate([color[..., :3] + 0.1, np.ones_like(color[..., 3:])], -1)
    write_apart(tmp_path / "apart", paint=opaque)
    write_apart(tmp_path / "bright", world=5.0, paint=opaque)
    np.testing.assert_array_equal(*(finished_linear(tmp_path / name, "bicubic") for name in ("apart", "bright")))


@pytest.mark.parametrize("name", ["nearest", "bilinear"])
def test_a_subject_of_the_worlds_colour_is_not_seen(tmp_path, name):
    """Colour and what it hides are upscaled alike: no seam is left where they meet."""
    write_apart(tmp_path, world=1.0, paint=lambda color: np.repeat(color[..., 3:], 4, -1))
    np.testing.assert_allclose(finished_linear(tmp_path, name), 1.0, atol=1e-5)


def test_guides_do_not_show_the_world(tmp_path):
    """Cycles adds to the albedo what shows of a world that is rendered apart; opacity is denoised without guides."""
    frame = read_frame(write_apart(tmp_path))
    layers = read_layers(tmp_path / LOW_RES_FILE)
    world = layers["environment"]
    guided = layers | {"albedo": 0.5 * (1 - world) + world, "normal": np.zeros_like(world)}
    low = low_resolution(guided, frame, read_world(tmp_path, frame))
    np.testing.assert_allclose(low.guides[..., :3], 0.5 * low.opacity, atol=1e-6)
    assert low.guides.shape == (*low.color.shape[:4], 6)
    found, plain = (load_method("denoise+bilinear").prepare(each)
                    for each in (low, dataclasses.replace(low, guides=None)))
    np.testing.assert_array_equal(found.opacity, plain.opacity)
    assert not np.array_equal(found.color, plain.color)


def test_sampled_lenses_are_finished_as_those_of_a_frame(tmp_path):
    """Wherever they lie in a mosaic."""
    frame = read_frame(write_apart(tmp_path))
    layers, lenses = read_layers(tmp_path / LOW_RES_FILE), np.array([(3, 5), (6, 9), (0, 0), (6, 8)])
    low, mask = low_resolution(layers, frame, read_world(tmp_path, frame)), low_res.foreground_mask(layers, MINI.lenses)
    mosaic = low.each(lambda layer: layer[lenses[:, 0], lenses[:, 1]][None])
    found = finished_lenses(mosaic, mask[tuple(lenses.T)], "bicubic", np.array([(0, n) for n in range(4)]))
    whole = to_elemental_images(finished_linear(tmp_path, "bicubic"), MINI.lenses)
    np.testing.assert_allclose(found, whole[tuple(lenses.T)], atol=1e-6)


def test_a_world_that_is_gone_or_of_another_size_is_refused(tmp_path):
    write_apart(tmp_path)
    frame = read_frame(tmp_path)
    write_layers(tmp_path / WORLD_FILE, {"color": np.ones((9, 7, 3), np.float32)})
    refuses("7×9 pixels, but its frame.json asks for", finished_linear, tmp_path, "bilinear")
    (tmp_path / WORLD_FILE).unlink()
    refuses(r"world\.exr", finished_linear, tmp_path, "bilinear")
    assert read_world(tmp_path, dataclasses.replace(frame, world_apart=False)) is None
