import dataclasses
import subprocess
import sys

import numpy as np
import pytest

from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct.denoiser import WEIGHTS, load, read_tza, write_tza
from lfsr_core.reconstruct.methods import denoise, oidn
from lfsr_core.reconstruct.methods.denoise import (
    denoise_eia,
    denoise_low_resolution,
    shown_part,
    span,
)
from tests.support.prerequisites import needs_bpy
from tests.support.told import refuses

RANDOM = np.random.default_rng(0)


def noisy_card(noise=0.5):
    """A card of eight bright stripes, (64, 96, 3), and the same with Monte Carlo-like noise."""
    clean = np.full((64, 96, 3), 0.1, np.float32)
    clean[:, (np.arange(96) // 12) % 2 == 1] = [3.0, 0.6, 0.2]
    return clean, np.maximum(clean * RANDOM.gamma(1 / noise**2, noise**2, clean.shape), 0).astype(np.float32)


def error(image, clean):
    return float(np.mean(((image - clean) / (clean + 0.1)) ** 2))


@pytest.mark.parametrize("weights", [None, WEIGHTS])
def test_noise_goes_and_brightness_stays(weights):
    clean, noisy = noisy_card()
    denoised = denoise_eia(noisy, weights=weights and load(weights))
    assert denoised.shape == noisy.shape and denoised.dtype == np.float32 and denoised.min() >= 0
    assert error(denoised, clean) < error(noisy, clean) / 5
    assert denoised.mean() == pytest.approx(clean.mean(), rel=0.1)
    assert denoised.max() > 2, "values above 1 must survive"


def low_resolution():
    """A noisy card as 8×8 lenses."""
    color = noisy_card()[1].reshape(8, 8, 12, 8, 3).swapaxes(1, 2)
    return LowResEIA(color, np.ones((*color.shape[:-1], 1), np.float32), 16, 4)


def framed(row=9, column=13):
    """The noisy card amid 30×40 lenses that show nothing."""
    card = low_resolution()
    part = slice(row, row + 8), slice(column, column + 12)
    images = {}
    for name, image in (("color", card.color), ("alpha", card.alpha)):
        images[name] = np.zeros((30, 40, *image.shape[2:]), np.float32)
        images[name][part] = image
    return LowResEIA(images["color"], images["alpha"], 16, 4), part


@pytest.mark.parametrize("weights", [None, WEIGHTS])
def test_only_what_shows_something_is_denoised(monkeypatch, weights):
    low, part = framed()
    sizes = []

    def spy(color, *arguments, **options):
        sizes.append(color.shape[0] * color.shape[1])
        return denoise_eia(color, *arguments, **options)

    monkeypatch.setattr(denoise, "denoise_eia", spy)
    denoised = denoise_low_resolution(low, weights).color
    assert len(sizes) == 1 and sizes[0] < low.alpha.size / 3
    outside = denoised.copy()
    outside[part] = 0
    assert outside.max() < 0.3, "only what spills over a border"
    monkeypatch.setattr(denoise, "shown_part", lambda _: (slice(None), slice(None)))
    expected = denoise_low_resolution(low, weights).color
    np.testing.assert_allclose(denoised[part], expected[part], rtol=0.1, atol=0.05)


@pytest.mark.parametrize("factor", [1e3, 3e4])
def test_weights_that_overflow_are_refused(tmp_path, factor):
    tensors = read_tza(WEIGHTS)
    write_tza(tmp_path / "black.tza", {name: np.clip(tensor.astype(float) * factor, -6e4, 6e4)
                                       for name, tensor in tensors.items()})
    with pytest.raises(LfsrError, match="of 96 elemental images black or infinite"):
        denoise_low_resolution(framed()[0], tmp_path / "black.tza")


def test_exposure_is_what_the_weights_see():
    """A frame that is four times as dark, and exposed two stops more, is denoised alike."""
    low = low_resolution()
    dark = dataclasses.replace(low, color=low.color / 4, exposure=2.0)
    expected = denoise_low_resolution(low).color
    np.testing.assert_allclose(denoise_low_resolution(dark).color * 4, expected, rtol=1e-3, atol=1e-4)
    unexposed = denoise_low_resolution(dataclasses.replace(dark, exposure=0.0)).color * 4
    assert not np.allclose(unexposed, expected, rtol=1e-3, atol=1e-4)


def test_nothing_to_denoise_stays_as_it_is():
    low, part = framed()
    empty = dataclasses.replace(low, color=np.full_like(low.color, 0.25))
    np.testing.assert_array_equal(denoise_low_resolution(empty).color, empty.color)
    for corner in [(0, 0), (3, 9), (9, 13), (22, 28)]:
        rows, columns = shown_part(framed(*corner)[0].color)
        for part, start, length, count in ((rows, corner[0], 8, 30), (columns, corner[1], 12, 40)):
            assert 0 <= part.start <= max(start - 4, 0) and min(start + length + 4, count) <= part.stop <= count
            assert part.start * 8 % 16 == 0, "the library pools the same pixels as in the whole image"
    for pixels in [4, 10, 20, 32]:
        for first in range(20):
            wanted = np.arange(30) == first
            found = span(wanted, pixels)
            assert found.start * pixels % 16 == 0 and found.stop == min(30, first + 1 + -(-32 // pixels))
            assert found.start <= max(first - 32 // pixels, 0)
        assert span(np.zeros(5, bool), pixels) == slice(0, 0)


@needs_bpy
def test_library_of_blender_gives_the_same_image(monkeypatch):
    _, noisy = noisy_card()

    def images():
        return denoise_eia(noisy), denoise_eia(noisy, weights=load())

    expected = images()
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    for found, wanted in zip(images(), expected, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-3, atol=1e-4)


def test_missing_library_is_one_clear_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    monkeypatch.setattr(oidn, "find_libraries", lambda: iter(()))
    refuses("install the package pyoidn", denoise_eia, np.zeros((4, 4, 3), np.float32))


def test_denoising_does_not_load_pytorch():
    program = ("import sys, numpy as np\nfrom lfsr_core.reconstruct.methods.denoise import denoise_eia\n"
               "denoise_eia(np.ones((16, 16, 3), np.float32))\nassert 'torch' not in sys.modules\n"
               "import importlib.util\nif importlib.util.find_spec('torch'): import torch; torch.ones(1)\n")
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
