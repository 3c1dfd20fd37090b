"""Photographs for training: folders, crops, low-resolution pairs."""

from __future__ import annotations

import os

import numpy as np
import pytest
import torch

from lfsr_core.base.errors import LfsrError
from lfsr_lab.networks.upscalers import srgb_decode
from lfsr_lab.train.photographs.task import CropSampler, Photographs, downsample, load_photographs
from tests.support.training_photographs import some_photographs, write_photographs

CPU = torch.device("cpu")


@pytest.fixture
def folder(tmp_path):
    return write_photographs(tmp_path / "photographs")


def test_a_folder_is_read_pixel_by_pixel(folder):
    original = load_photographs(folder)
    assert [image.tolist() for image in original.images] == [image.tolist() for image in some_photographs().images]


def test_reduction_keeps_the_mean(folder):
    reduced = load_photographs(folder, long_side=26)
    assert [max(image.shape) for image in reduced.images] == [26, 26, 26]
    for small_image, image in zip(reduced.images, some_photographs().images, strict=True):
        np.testing.assert_allclose(small_image.mean((0, 1)), image.mean((0, 1)), atol=3)


def test_digest_depends_on_pixels_and_names():
    one, other = some_photographs(), some_photographs(seed=1)
    renamed = Photographs(("a.png", *one.names[1:]), one.images)
    assert len({one.digest, other.digest, renamed.digest}) == 3


def test_bad_photographs(tmp_path):
    with pytest.raises(LfsrError, match="holds no photographs"):
        load_photographs(tmp_path)
    (tmp_path / "a.jpg").write_bytes(b"not an image")
    with pytest.raises(LfsrError, match="cannot be read as a photograph .*: remove it or get it again"):
        load_photographs(tmp_path)
    (tmp_path / "a.jpg").unlink()
    os.mkfifo(tmp_path / "a.png")
    with pytest.raises(LfsrError, match=r"a\.png .*not a regular file"):
        load_photographs(tmp_path)
    with pytest.raises(LfsrError, match="0.png is smaller than a crop of 64"):
        CropSampler(some_photographs(), 64, 2, 0, CPU)


def crops(seed=7, epoch=0, per_photograph=40):
    sampler = CropSampler(some_photographs(), 16, per_photograph, seed, CPU)
    sampler.begin(epoch, 4)
    return sampler


def turned(image):
    """The eight turns and mirror images of (16, 16, 3) or of its windows (..., 3, 16, 16)."""
    every = [np.flip(image, axes) for axes in ((), (-1,), (-2,), (-1, -2))]
    return every + [other.swapaxes(-1, -2) for other in every]


def test_crops_are_parts_of_their_photographs_turned_in_every_way():
    windows = np.concatenate([np.lib.stride_tricks.sliding_window_view(image, (16, 16), (0, 1)).reshape(-1, 3, 16, 16)
                              for image in some_photographs().images])
    batches = list(crops())
    assert len(batches) == 30 and batches[0].shape == (4, 3, 16, 16)
    seen = set()
    for batch in batches:
        ways = [{index for index, way in enumerate(turned(crop)) if (windows == way).all((1, 2, 3)).any()}
                for crop in (batch * 255).round().byte().numpy()]
        assert all(ways)
        seen |= set.intersection(*ways)
    assert seen == set(range(8))


def test_epochs_are_seeded_and_differ():
    assert torch.equal(crops(1, 5)[0], crops(1, 5)[0])
    assert not torch.equal(crops(1, 5)[0], crops(1, 6)[0])
    assert not torch.equal(crops(1, 5)[0], crops(2, 5)[0])


def test_downsampling_is_the_mean_light():
    high = torch.rand(2, 3, 8, 12)
    mean = srgb_decode(high).reshape(2, 3, 2, 4, 3, 4).mean((3, 5))
    torch.testing.assert_close(srgb_decode(downsample(high, 4)), mean, atol=1e-5, rtol=1e-4)
