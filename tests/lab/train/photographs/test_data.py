"""Photographs for training: caches, crops, low-resolution pairs."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from lfsr_core.errors import LfsrError
from lfsr_lab.networks.srgb import srgb_decode
from lfsr_lab.train.photographs.data import (
    Crops,
    CropSampler,
    Photographs,
    downsample,
    load_photographs,
    write_cache,
)
from tests.support.training_photographs import some_photographs, write_photographs

CPU = torch.device("cpu")


@pytest.fixture
def folder(tmp_path):
    return write_photographs(tmp_path / "photographs")


def test_folder_and_lossless_cache_hold_the_same_pixels(folder, tmp_path):
    original = load_photographs(folder)
    assert [image.tolist() for image in original.images] == [image.tolist() for image in some_photographs().images]
    size = write_cache(original, tmp_path / "cache.npz", quality=101)
    cached = load_photographs(tmp_path / "cache.npz")
    assert size == (tmp_path / "cache.npz").stat().st_size
    assert (cached.names, cached.digest) == (original.names, original.digest)


def test_jpeg_cache_is_near_and_reduction_keeps_the_mean(folder, tmp_path):
    reduced = load_photographs(folder, long_side=26)
    assert [max(image.shape) for image in reduced.images] == [26, 26, 26]
    for small_image, image in zip(reduced.images, some_photographs().images, strict=True):
        np.testing.assert_allclose(small_image.mean((0, 1)), image.mean((0, 1)), atol=3)
    write_cache(some_photographs(), tmp_path / "cache.npz", quality=92)
    for image, other in zip(load_photographs(tmp_path / "cache.npz").images, some_photographs().images, strict=True):
        assert 0 < np.abs(image.astype(int) - other).mean() < 3


def test_digest_depends_on_pixels_and_names():
    one, other = some_photographs(), some_photographs(seed=1)
    renamed = Photographs(("a.png", *one.names[1:]), one.images)
    assert len({one.digest, other.digest, renamed.digest}) == 3


def test_bad_photographs(tmp_path):
    with pytest.raises(LfsrError, match="holds no photographs"):
        load_photographs(tmp_path)
    (tmp_path / "a.jpg").write_bytes(b"not an image")
    with pytest.raises(LfsrError, match="cannot be decoded"):
        load_photographs(tmp_path)
    (tmp_path / "b.npz").write_bytes(b"no cache")
    with pytest.raises(LfsrError, match="cannot be read as a cache"):
        load_photographs(tmp_path / "b.npz")
    np.savez(tmp_path / "c.npz", a=np.zeros(3))
    with pytest.raises(LfsrError, match="another format"):
        load_photographs(tmp_path / "c.npz")
    with pytest.raises(LfsrError, match="0.png is smaller than a crop of 64"):
        CropSampler(some_photographs(), Crops(64, 2, seed=0), CPU)


def test_crops_are_parts_of_their_photographs():
    photographs = some_photographs()
    sampler = CropSampler(photographs, Crops(16, 4, seed=7, augment=False), CPU)
    epoch = sampler.epoch(0, 4)
    assert len(epoch) == 3 and epoch[0].shape == (4, 3, 16, 16)
    windows = [np.lib.stride_tricks.sliding_window_view(image, (16, 16), (0, 1)) for image in photographs.images]
    for batch in epoch:
        for crop in (batch * 255).round().byte().numpy():
            assert any((window == crop).all((2, 3, 4)).any() for window in windows)


def test_augmented_crops_are_turned_ones():
    plain = CropSampler(some_photographs(), Crops(16, 40, seed=7, augment=False), CPU).epoch(0, 4)
    turned = CropSampler(some_photographs(), Crops(16, 40, seed=7), CPU).epoch(0, 4)
    seen = set()
    for before, after in zip(plain, turned, strict=True):
        every = [before.flip(axes) if axes else before for axes in ([], [2], [3], [2, 3])]
        every += [image.transpose(2, 3) for image in every]
        seen |= {index for index, image in enumerate(every) if torch.equal(image, after)}
    assert seen == set(range(8))


def test_epochs_are_seeded_and_differ():
    def first(seed, epoch):
        return CropSampler(some_photographs(), Crops(16, 4, seed), CPU).epoch(epoch, 4)[0]

    assert torch.equal(first(1, 5), first(1, 5))
    assert not torch.equal(first(1, 5), first(1, 6))
    assert not torch.equal(first(1, 5), first(2, 5))


def test_box_in_linear_light_is_the_mean_light():
    high = torch.rand(2, 3, 8, 12)
    low = downsample(high, 4, "box", linear_light=True)
    mean = srgb_decode(high).reshape(2, 3, 2, 4, 3, 4).mean((3, 5))
    torch.testing.assert_close(srgb_decode(low), mean, atol=1e-5, rtol=1e-4)
    encoded = downsample(high, 4, "box", linear_light=False)
    torch.testing.assert_close(encoded, high.reshape(2, 3, 2, 4, 3, 4).mean((3, 5)))


def test_bicubic_downsampling_keeps_a_ramp():
    ramp = torch.linspace(0.2, 0.8, 64).expand(1, 3, 64, 64)
    low = downsample(ramp, 4, "bicubic", linear_light=False)
    torch.testing.assert_close(low[..., 2:-2, 2:-2], ramp.reshape(1, 3, 16, 4, 16, 4).mean((3, 5))[..., 2:-2, 2:-2],
                               atol=1e-3, rtol=0)
