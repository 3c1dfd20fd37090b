"""The methods of others, with weights made by hand whose result is known, and the order of their views."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter

from lfsr_core.base.errors import LfsrError
from lfsr_lab.experiments.rivals import lfbm5d
from lfsr_lab.experiments.rivals.lfbm5d import WEIGHTS, LFDnPatch, _seen
from lfsr_lab.experiments.rivals.makers import EPICNN, AngularSR, of_cells
from lfsr_lab.experiments.rivals.sheared_epi import ShearedEPI, weighted_median
from tests.support import stored_weights as stored


def linear(views, ratio):
    places = np.arange(ratio * (len(views) - 1) + 1) / ratio
    weights = np.maximum(1 - np.abs(places[:, None] - np.arange(len(views))), 0)
    return np.einsum("ai,bj,ijhwc->abhwc", weights, weights, views)


@pytest.fixture(scope="module")
def texture():
    noise = gaussian_filter(np.random.default_rng(0).normal(0.5, 2, (40, 96, 3)), (1.5, 1.5, 0))
    return np.clip(noise, 0, 1)


def shifted(texture, y, x):
    return np.roll(texture, (-y, -x), (0, 1))[4:36, 16:80]


def test_sheared_epi_finds_the_shear_of_each_view(texture, tmp_path):
    stored.differences(tmp_path)
    corners = np.stack([np.stack([shifted(texture, 4 * y, 4 * x) for x in (0, 1)]) for y in (0, 1)])
    made = ShearedEPI(tmp_path, 5)(corners, 4)
    for y, x in [(0, 1), (2, 2), (3, 1), (4, 3)]:
        ours, mixed = (np.abs(views[y, x] - shifted(texture, y, x))[6:-6, 8:-8].mean() for views in (
            made, linear(corners, 4)))
        assert ours < 0.02 < mixed
    np.testing.assert_array_equal(made[::4, ::4], corners)


def test_a_weighted_median_keeps_edges_of_its_guide():
    guide = np.zeros((20, 20, 3))
    guide[:, 10:] = 200
    labels = (guide[..., 0] > 0).astype(int) * 3
    labels[4, 4], labels[5, 15] = 5, 0
    clean = weighted_median(labels, guide, 6)
    assert (clean[:, :10] == 0).all() and (clean[:, 10:] == 3).all()


def test_epicnn_interpolates_both_axes_of_views(texture, tmp_path):
    stored.tent(tmp_path)
    grey = np.repeat(np.stack([np.stack([shifted(texture, y, 2 * x) for x in range(3)]) for y in range(2)])[..., :1], 3,
                     -1)
    made = EPICNN(tmp_path)(grey)
    assert made.shape[:2] == (4, 7)
    places = [np.maximum(1 - np.abs(np.arange(3 * n - 2)[:, None] / 3 - np.arange(n)), 0) for n in (2, 3)]
    np.testing.assert_allclose(made, np.einsum("ai,bj,ijhwc->abhwc", *places, grey), atol=2e-3)
    assert EPICNN(tmp_path)(grey[:1]).shape[:2] == (1, 7)


@pytest.mark.parametrize("pairs", [1, 2])
def test_angular_sr_puts_new_views_in_the_order_of_matlab(tmp_path, pairs):
    """Columns first, without the corners: number 6 lies below the top right of the first column's six."""
    stored.numbered(tmp_path, pairs)
    corners = torch.tensor([[0.1, 0.2], [0.3, 0.4]])[:, :, None, None].expand(2, 2, 140, 3)
    luma = AngularSR(tmp_path, pairs).luma(corners)[:, :, 70, 1]
    np.testing.assert_allclose(luma[::7, ::7], [[0.1, 0.2], [0.3, 0.4]])
    np.testing.assert_allclose(luma[1:7, 0] * 100, range(6), atol=1e-5)
    np.testing.assert_allclose(luma[:, 1] * 100, range(6, 14), atol=1e-5)
    colour = np.broadcast_to(np.random.default_rng(0).random((2, 2, 1, 1, 3)), (2, 2, 140, 3, 3))
    made = AngularSR(tmp_path, pairs)(colour)
    assert made.shape == (8, 8, 140, 3, 3) and np.ptp(made[3, 3, :, 0, 0]) < 1e-6  # bands join
    np.testing.assert_array_equal(made[::7, ::7], colour)


def test_cells_of_views_share_their_borders():
    views = np.random.default_rng(0).random((3, 3, 2, 2, 3)).astype(np.float32)
    np.testing.assert_allclose(of_cells(views, 4, lambda corners: linear(corners, 4)), linear(views, 4), atol=1e-6)


def test_lfdnpatch_sees_the_patches_that_match(texture, tmp_path):
    views = np.stack([np.stack([shifted(texture, 2 * y, 3 * x) for x in range(4)]) for y in range(3)])
    whole = np.round(views * 255).astype(np.int16)
    seen = _seen(whole, 1, 1)
    np.testing.assert_array_equal(seen[..., -3:], whole[1, 1])
    inside = seen[:20, 20:40].reshape(20, 20, 7, 3)  # three views of its row and the one above see all of it
    assert all(np.abs(inside[:, :, number] - inside[:, :, -1]).max() == 0 for number in range(4))
    path = tmp_path / WEIGHTS
    path.parent.mkdir(parents=True)
    weight = torch.zeros(3, 21, 3, 3)
    weight[range(3), range(3), 1, 1] = -0.5
    torch.save({"model.0.weight": weight, "model.0.bias": torch.full((3,), 0.1)}, path)
    expected = (seen[..., -3:] + 0.5 * seen[..., :3]) / 255 - 0.1
    np.testing.assert_allclose(LFDnPatch(tmp_path)(views)[1, 1], np.clip(expected, 0, 1), atol=1e-6)


def test_noise_is_estimated_and_views_keep_their_places(tmp_path):
    random = np.random.default_rng(0)
    assert lfbm5d.deviation(random.normal(0.5, 0.1, (200, 200))) == pytest.approx(0.1, rel=0.05)
    assert lfbm5d.deviation(np.zeros((8, 8))) == 0
    program = tmp_path / "LFBM5D" / lfbm5d.PROGRAM
    program.parent.mkdir()
    # A stand-in with its arguments: 4 and 5 count the views, 13 and 15 are the folders of noisy and clean ones.
    program.write_text('#!/bin/sh\n[ "$4 $5" = "3 2" ] && cp "${13}"/* "${15}"\n')
    program.chmod(0o755)
    views = random.integers(0, 256, (2, 3, 5, 7, 3)) / 255
    np.testing.assert_allclose(lfbm5d.denoised(lfbm5d.program(tmp_path), views), views, atol=1e-6)
    with pytest.raises(LfsrError, match="ended with 1 and no views"):
        lfbm5d.denoised(program, views[:, :2])


def test_what_is_missing_is_one_sentence(tmp_path):
    with pytest.raises(LfsrError, match="has no program LFBM5Ddenoising: compile it"):
        lfbm5d.program(tmp_path)
    with pytest.raises(LfsrError, match="clone the repository 'lfepicnn' into"):
        EPICNN(tmp_path)
