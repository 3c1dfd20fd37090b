import dataclasses
import subprocess
import sys

import numpy as np
import pytest
from lfsr_core.reconstruct.methods.guides import guides_of

from lfsr_core.errors import LfsrError
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct.methods import denoise, oidn
from lfsr_core.reconstruct.methods.denoise import (
    denoise_at_half,
    denoise_both_ways,
    denoise_eia,
    denoise_low_resolution,
    mean_of_both,
    shown_part,
)
from tests.support.prerequisites import needs_bpy

RANDOM = np.random.default_rng(0)


def noisy_card(noise=0.5):
    """A card of eight bright stripes, (64, 96, 3), and the same with Monte Carlo-like noise."""
    clean = np.full((64, 96, 3), 0.1, np.float32)
    clean[:, (np.arange(96) // 12) % 2 == 1] = [3.0, 0.6, 0.2]
    return clean, np.maximum(clean * RANDOM.gamma(1 / noise**2, noise**2, clean.shape), 0).astype(np.float32)


def error(image, clean):
    return float(np.mean(((image - clean) / (clean + 0.1)) ** 2))


def test_noise_goes_and_brightness_stays():
    clean, noisy = noisy_card()
    denoised = denoise_eia(noisy)
    assert denoised.shape == noisy.shape and denoised.dtype == np.float32 and denoised.min() >= 0
    assert error(denoised, clean) < error(noisy, clean) / 5
    assert denoised.mean() == pytest.approx(clean.mean(), rel=0.1)
    assert denoised.max() > 2, "values above 1 must survive"


def test_albedo_and_normal_help():
    clean, noisy = noisy_card(noise=1.5)
    albedo = np.clip(clean / 3, 0, 1)
    normal = np.zeros_like(clean) + np.float32([0, 0, 1])
    assert error(denoise_eia(noisy, albedo, normal), clean) < 0.8 * error(denoise_eia(noisy), clean)


def test_normal_without_albedo_is_left_out():
    _, noisy = noisy_card()
    np.testing.assert_array_equal(denoise_eia(noisy, normal=np.ones_like(noisy)), denoise_eia(noisy))


def low_resolution():
    """A noisy card as 8×8 lenses, with a noisy albedo."""
    clean, noisy = noisy_card()
    albedo = np.clip(clean / 3 + RANDOM.normal(0, 0.02, clean.shape), 0, 1).astype(np.float32)
    color, albedo = (image.reshape(8, 8, 12, 8, 3).swapaxes(1, 2) for image in (noisy, albedo))
    return LowResEIA(color, np.ones((*color.shape[:-1], 1), np.float32), 16, 4, albedo=albedo)


def whole(images):
    return images.swapaxes(1, 2).reshape(64, 96, 3)


def test_low_resolution_eia_is_denoised_as_one_image():
    low = low_resolution()
    denoised = denoise_low_resolution(low)
    np.testing.assert_allclose(whole(denoised.color), denoise_eia(whole(low.color)), atol=1e-5)
    assert denoised.noisy is low.color and denoised.albedo is low.albedo and denoised.scale == 4


def framed(row=9, column=13):
    """The noisy card amid 30×40 lenses that show nothing, with its albedo."""
    card = low_resolution()
    part = slice(row, row + 8), slice(column, column + 12)
    images = {}
    for name, image in (("color", card.color), ("alpha", card.alpha), ("albedo", card.albedo)):
        images[name] = np.zeros((30, 40, *image.shape[2:]), np.float32)
        images[name][part] = image
    return LowResEIA(images["color"], images["alpha"], 16, 4, albedo=images["albedo"]), part


@pytest.mark.parametrize("guided", [False, True])
def test_only_what_shows_something_is_denoised(monkeypatch, guided):
    low, part = framed()
    sizes = []

    def spy(color, *arguments, **options):
        sizes.append(color.shape[0] * color.shape[1])
        return denoise_eia(color, *arguments, **options)

    monkeypatch.setattr(denoise, "denoise_eia", spy)
    denoised = denoise_low_resolution(low, guided=guided).color
    assert len(sizes) == 1 + guided and max(sizes) < low.alpha.size / 3
    outside = denoised.copy()
    outside[part] = 0
    assert outside.max() < 0.3, "only what spills over a border"
    monkeypatch.setattr(denoise, "shown_part", lambda color, parallax: (slice(None), slice(None)))
    expected = denoise_low_resolution(low, guided=guided).color
    np.testing.assert_allclose(denoised[part], expected[part], rtol=0.1, atol=0.05)


def test_views_along_one_axis_are_denoised_as_whole_views():
    clean, noisy = noisy_card()
    # Three views of 64×32 lenses, each a third of the card.
    views = np.stack(np.split(noisy, 3, axis=1))
    low = LowResEIA(np.ascontiguousarray(views.transpose(1, 2, 0, 3))[:, :, None],
                    np.ones((64, 32, 1, 3, 1), np.float32), 16, 4, parallax=(True, False))
    denoised = denoise_low_resolution(low)
    expected = denoise_eia(np.concatenate(list(views)))
    np.testing.assert_array_equal(denoised.color[:, :, 0].transpose(2, 0, 1, 3).reshape(-1, 32, 3), expected)
    np.testing.assert_array_equal(denoised.noisy, low.color)
    assert low.finished_views == (1, 12)


def test_nothing_to_denoise_stays_as_it_is():
    low, part = framed()
    empty = dataclasses.replace(low, color=np.full_like(low.color, 0.25))
    np.testing.assert_array_equal(denoise_low_resolution(empty, guided=True).color, empty.color)


@pytest.mark.parametrize("corner", [(0, 0), (3, 9), (9, 13), (22, 28)])
def test_part_holds_every_lens_that_shows_something(corner):
    rows, columns = shown_part(framed(*corner)[0].color)
    for part, start, length, count in ((rows, corner[0], 8, 30), (columns, corner[1], 12, 40)):
        assert 0 <= part.start <= max(start - 4, 0) and min(start + length + 4, count) <= part.stop <= count
        assert part.start * 8 % 16 == 0, "the library pools the same pixels as in the whole image"


def test_guides_are_smoothed_first():
    low = low_resolution()
    low = dataclasses.replace(low, albedo=0.5 + low.albedo / 10)
    guides = guides_of({"albedo": low.albedo}, low.samples, lambda images: images, (8, 8))
    assert not guides.detail.any() and not np.allclose(guides.images["albedo"], low.albedo, atol=1e-3)
    expected = denoise_eia(whole(low.color), whole(guides.images["albedo"]))
    np.testing.assert_allclose(whole(denoise_low_resolution(low, guided=True).color), expected, atol=1e-5)


def test_both_ways_are_two_images():
    low = low_resolution()
    both = denoise_both_ways(low)
    np.testing.assert_array_equal(both.color, denoise_low_resolution(low).color)
    np.testing.assert_array_equal(both.guided, denoise_low_resolution(low, guided=True).color)
    assert np.abs(both.guided - both.color).max() > 1e-3 and both.noisy is low.color
    bare = denoise_both_ways(dataclasses.replace(low, albedo=None))
    assert set(bare.layers) == {"noisy"}


def test_of_both_images_the_mean_is_between_them():
    clean, low = matte()
    both = denoise_both_ways(low)
    mean = mean_of_both(both)
    np.testing.assert_allclose(mean.color, (both.color + both.guided) / 2)
    assert mean.guided is None and mean.noisy is low.color
    assert error(mean.color, clean) < error(both.guided, clean)
    assert mean_of_both(low) is low


def matte(texture=0.0, samples=16):
    """8×8 lenses of 12×12 views: lit from the left, tiled by ``texture``, three views each; noise of 16 samples."""
    lens = np.add.outer(np.arange(8), np.arange(8))[:, :, None, None] / 16
    tiles = np.add.outer(np.arange(12) // 3, np.arange(12) // 3) % 2 - 0.5
    albedo = np.clip(0.5 + texture * tiles + np.zeros((8, 8, 1, 1)), 0, 1)[..., None].repeat(3, -1).astype(np.float32)
    clean = (albedo * (0.2 + lens[..., None])).astype(np.float32)
    noise = RANDOM.gamma(4, 1 / 4, clean.shape).astype(np.float32)
    return clean, LowResEIA(clean * noise, np.ones((*clean.shape[:-1], 1), np.float32), samples, 4, albedo=albedo)


def test_half_the_resolution_is_nearer_where_views_are_alike():
    clean, low = matte()
    half = denoise_at_half(low)
    assert half.noisy is low.color and half.color.shape == low.color.shape and half.color.min() >= 0
    assert error(half.color, clean) < error(denoise_low_resolution(low, guided=True).color, clean)


def test_where_guides_show_detail_the_resolution_is_whole():
    clean, low = matte(texture=0.8)
    guided = denoise_low_resolution(low, guided=True).color
    np.testing.assert_allclose(denoise_at_half(low).color, guided, atol=1e-5)
    np.testing.assert_allclose(denoise_both_ways(low).color, guided, atol=1e-5)
    assert error(guided, clean) < error(low.color, clean) / 2


def test_detail_in_some_lenses_leaves_the_others_at_half_the_resolution():
    (_, low), (_, tiled) = matte(), matte(texture=0.8)
    color, albedo = low.color.copy(), low.albedo.copy()
    color[:2, :2], albedo[:2, :2] = tiled.color[:2, :2], tiled.albedo[:2, :2]
    some = dataclasses.replace(low, color=color, albedo=albedo)
    guided, half = denoise_low_resolution(some, guided=True).color, denoise_at_half(some).color
    assert np.abs(half[:2, :2] - guided[:2, :2]).mean() < 0.02
    assert not np.allclose(half[4:], guided[4:], atol=1e-3)
    both = denoise_both_ways(some)
    np.testing.assert_allclose(both.color[4:], half[4:], atol=1e-5)
    np.testing.assert_array_equal(both.guided, guided)


def test_a_shadow_that_no_guide_shows_keeps_the_whole_resolution():
    _, low = matte()
    clean = np.full_like(low.color, 0.5)
    clean[:, :4] *= np.where(np.arange(12) // 2 % 2, 1, 0.3).astype(np.float32)[:, None]
    noise = np.random.default_rng(1).gamma(64, 1 / 64, clean.shape).astype(np.float32)
    shaded = dataclasses.replace(low, color=clean * noise, albedo=np.full_like(clean, 0.5))
    both, half = denoise_both_ways(shaded), denoise_at_half(shaded).color
    np.testing.assert_allclose(both.color[:, :3], both.guided[:, :3], atol=1e-5)
    assert error(both.color[:, :3], clean[:, :3]) < error(half[:, :3], clean[:, :3]) / 2


def test_small_elemental_images_are_not_halved():
    low = low_resolution()
    np.testing.assert_array_equal(denoise_at_half(low).color, denoise_low_resolution(low, guided=True).color)


@pytest.mark.parametrize("way", [denoise_at_half, denoise_both_ways])
def test_nothing_to_denoise_at_half_stays_as_it_is(way):
    _, low = matte()
    empty = dataclasses.replace(low, color=np.full_like(low.color, 0.25))
    np.testing.assert_array_equal(way(empty).color, empty.color)


def test_fast_is_another_and_nearly_as_good_image():
    clean, noisy = noisy_card()
    fast, high = denoise_eia(noisy, fast=True), denoise_eia(noisy)
    assert not np.array_equal(fast, high) and error(fast, clean) < 2 * error(high, clean)


@needs_bpy
def test_library_of_blender_gives_the_same_image(monkeypatch):
    clean, noisy = noisy_card()
    albedo, normal = np.clip(clean / 3, 0, 1), np.zeros_like(clean) + np.float32([0, 0, 1])
    def images():
        return denoise_eia(noisy), denoise_eia(noisy, albedo, normal), denoise_eia(noisy, fast=True)

    expected = images()
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    for found, wanted in zip(images(), expected, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-3, atol=1e-4)


def test_missing_library_is_one_clear_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    monkeypatch.setattr(oidn, "find_libraries", lambda: iter(()))
    with pytest.raises(LfsrError, match="install the package pyoidn"):
        denoise_eia(np.zeros((4, 4, 3), np.float32))


def test_denoising_does_not_load_pytorch():
    program = ("import sys, numpy as np\nfrom lfsr_core.reconstruct.methods.denoise import denoise_eia\n"
               "denoise_eia(np.ones((16, 16, 3), np.float32))\nassert 'torch' not in sys.modules\n"
               "import importlib.util\nif importlib.util.find_spec('torch'): import torch; torch.ones(1)\n")
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
