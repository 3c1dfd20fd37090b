"""Layers and functions that were rewritten, against values computed by hand and against plain loops."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from lfsr_lab.experiments.rivals import matlab


def test_a_transposed_convolution_puts_the_filter_at_every_step():
    weight = np.array([[1.0, 10], [100, 1000]])[:, :, None, None]
    made = matlab.transposed(torch.tensor([[[[1.0, 2]]]]), weight, np.array([0.5]), (2, 2))
    np.testing.assert_allclose(made[0, 0], np.array([[1, 10, 2, 20], [100, 1000, 200, 2000]]) + 0.5)


def test_a_convolution_does_not_turn_its_filter():
    weight = np.zeros((3, 3, 1, 1))
    weight[0, 1] = 1  # the pixel above
    made = matlab.convolution(torch.arange(6.0).reshape(1, 1, 3, 2), weight, np.zeros(1), 1)
    np.testing.assert_array_equal(made[0, 0], [[0, 0], [0, 1], [2, 3]])


@pytest.mark.parametrize(("pad", "step"), [((1, 0), 1), ((0, 1), 2)])
def test_four_axes_are_convolved_as_by_loops(pad, step):
    random = np.random.default_rng(0)
    x, weight, bias = (random.normal(size=size) for size in [(3, 4, 2, 5, 6), (3, 2, 2, 3, 2, 3), 3])
    made = matlab.convolution_4d(torch.tensor(x, dtype=torch.float32), weight, bias, pad, step).numpy()
    wide = np.pad(x, [(pad[1], pad[1])] * 2 + [(0, 0)] + [(pad[0], pad[0])] * 2)
    for row, column, out, y, left in [(0, 0, 0, 0, 0), np.array(made.shape) - 1]:
        part = wide[row * step:row * step + 2, column * step:column * step + 3, :, y:y + 3, left:left + 2]
        expected = (part * weight[..., out].transpose(2, 3, 4, 0, 1)).sum() + bias[out]
        assert made[row, column, out, y, left] == pytest.approx(expected, rel=1e-4)


def test_resizing_is_cubic_convolution_with_a_mirror():
    # (-.5, 1.25 and 1.75 samples away, of which one is mirrored): -.0703125 - .0234375
    assert matlab.resize_matrix(2, 4)[0, 1] == pytest.approx(-0.09375)
    np.testing.assert_allclose(matlab.resize_matrix(7, 23).sum(1), 1)
    line = np.arange(30.0)
    np.testing.assert_allclose(matlab.resized(line, 0, 15)[3:-3], line.reshape(15, 2).mean(1)[3:-3])


def test_values_are_moved_and_unknown_outside():
    line = np.arange(8.0)**2
    np.testing.assert_array_equal(matlab.moved(line, 0, 2.0, cubic=True), [4, 9, 16, 25, 36, 49, np.nan, np.nan])
    np.testing.assert_allclose(matlab.moved(line, 0, -0.5, cubic=False)[:3], [np.nan, 0.5, 2.5])
    assert matlab.moved(line, 0, 0.5, cubic=True)[3] == pytest.approx(3.5**2)  # exact for a parabola


def test_colours_and_median():
    extremes = matlab.to_ycbcr(np.array([[1.0, 1, 1], [0, 0, 0]])) * 255
    np.testing.assert_allclose(extremes, [[235, 128, 128], [16, 128, 128]], atol=1e-6)
    colours = np.random.default_rng(1).random((5, 3))
    np.testing.assert_allclose(matlab.from_ycbcr(matlab.to_ycbcr(colours)), colours, atol=1e-9)
    spot = np.zeros((5, 5, 2))
    spot[2, 2], spot[:, 4, 1] = 9, 1
    assert not matlab.median3(spot)[..., 0].any() and matlab.median3(spot).shape == (5, 5, 2)
