"""Lost detail along epipolar lines: found where it is, not where there is only noise, and brought back."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct.methods import METHODS, load_method
from lfsr_core.reconstruct.methods.epipolar import LINES, Recovering, lost_fraction, sheared
from lfsr_core.reconstruct.methods.interpolation import averaged, decode, encode, interpolated

SY, SX, SIDE, SCALE = 8, 11, 8, 2
BOTH = (SCALE, SCALE)
NOISE = 0.05
EVERY = np.ones((SY, SX), bool)


def texture(step, seed=0, rows=SY, columns=SX, side=SIDE):
    """A light field (sy, sx, h, w) of values -1 or 1, alike wherever they lie on one line of ``step``."""
    lenses, views = step
    y, x, v, u = np.meshgrid(*map(np.arange, (rows, columns, side, side)), indexing="ij")
    # Constant along (lens + lenses, view + views).
    place = np.stack([views * y - lenses * v, views * x - lenses * u])
    place -= place.min(axis=(1, 2, 3, 4), keepdims=True)
    grid = np.random.default_rng(seed).choice([-1.0, 1.0], place.max(axis=(1, 2, 3, 4)) + 1)
    return grid[place[0], place[1]].astype(np.float32)


def noise(seed=1, shape=(SY, SX, SIDE, SIDE)):
    return np.random.default_rng(seed).normal(size=shape).astype(np.float32)


def light_field(detail, seed=1, alpha=None):
    """A denoised EIA without its ``detail`` (sy, sx, h, w), encoded, and in "noisy" one with it and with noise."""
    flat = np.full((*detail.shape, 3), 0.5, np.float32)
    noisy = decode(flat + detail[..., None] + NOISE * noise(seed, flat.shape))
    alpha = np.ones((*detail.shape, 1), np.float32) if alpha is None else alpha
    return LowResEIA(decode(flat), alpha, 16, SCALE, noisy=noisy)


def recovered(low, name="bilinear"):
    recovering = Recovering(METHODS[name].make().kernel)
    ready = recovering.prepare(low)
    return encode(recovering(ready, np.argwhere(np.ones(low.color.shape[:2], bool)))), recovering, ready


def test_one_sample_is_too_few():
    low = light_field(NOISE * texture((1, 1)))
    assert recovered(low)[2].lost.any() and recovered(dataclasses.replace(low, samples=2))[2].lost.any()
    assert not recovered(dataclasses.replace(low, samples=1))[2].lost.any()


@pytest.mark.parametrize("seed", range(5))
def test_noise_alone_is_no_detail(seed):
    fraction, _ = lost_fraction(noise(seed), EVERY)
    assert fraction.max() == 0
    low = light_field(np.zeros((SY, SX, SIDE, SIDE), np.float32), seed)
    image, recovering, ready = recovered(low)
    assert not ready.lost.any()
    np.testing.assert_allclose(image, 0.5, atol=1e-6)


@pytest.mark.parametrize("step", LINES)
def test_every_line_is_told_from_all_others(step):
    fraction, line = lost_fraction(0.5 * texture(step) + noise(), EVERY)
    middle = np.s_[2:-2, 3:-3]
    assert {LINES[index] for index in line[middle].flat} == {step}
    # A fifth of the variance is detail, less what noise could be.
    assert 0.05 < fraction[middle].mean() < 0.25


def test_fraction_is_that_of_the_variance():
    for strength in (0.5, 1.0, 2.0):
        fraction, _ = lost_fraction(strength * texture((1, 1)) + noise(), EVERY)
        true = strength**2 / (strength**2 + 1)
        assert true - 0.1 < fraction[2:-2, 2:-2].mean() < true + 0.02


def test_mirrored_light_fields_have_mirrored_lines():
    found = texture((1, 2)) + noise()
    fraction, line = lost_fraction(found, EVERY)
    other, mirrored = lost_fraction(np.ascontiguousarray(found[:, ::-1, :, ::-1]), EVERY)
    np.testing.assert_allclose(other[:, ::-1], fraction, rtol=1e-5)
    np.testing.assert_array_equal(mirrored[:, ::-1], line)


@pytest.mark.parametrize("step", [(1, 1), (-1, 2), (2, 3), (2, 1)])
def test_detail_comes_back_with_less_noise_than_was_rendered(step):
    detail = 0.1 * texture(step)
    low = light_field(detail)
    lost = recovered(low)[2].lost
    before = np.mean(detail**2)
    rendered = np.mean((encode(low.noisy) - 0.5 - detail[..., None]) ** 2)
    after = np.mean((lost - detail[..., None])[1:-1, 1:-1] ** 2)
    assert after < before / 4 and after < rendered


def test_upscaled_detail_keeps_its_mean_over_each_rendered_pixel():
    low = light_field(0.1 * texture((1, 1)))
    image, _, ready = recovered(low)
    rendered = image.reshape(SY, SX, SIDE, SCALE, SIDE, SCALE, 3).mean((3, 5))
    close = np.corrcoef((rendered - 0.5).ravel(), ready.lost.ravel())[0, 1]
    assert close > 0.95


@pytest.mark.parametrize("steep", [1.5, -1.5, 2.0, 3.0])
def test_views_between_the_rendered_ones_are_those_of_the_same_points(steep):
    """Waves on a plane off the display: what every view of every lens shows is known."""
    def seen(lens, view):
        return np.sin(0.9 * (lens - steep * view))

    views, fine = np.arange(SIDE), (np.arange(SIDE * SCALE) + 0.5) / SCALE - 0.5
    rows, columns = np.arange(SY)[:, None, None, None], np.arange(SX)[None, :, None, None]
    lost = seen(rows, views[:, None]) * seen(columns, views)
    truth = seen(rows, fine[:, None]) * seen(columns, fine)
    lost = np.repeat(lost[..., None], 3, -1).astype(np.float32)
    # Away from the display's edge, beyond which nothing is known, and from that of each EI.
    inside = np.array([[SY // 2, SX // 2]])
    found = sheared(lost, EVERY, inside, BOTH, steep)[0, :, :, 0]
    wrong = sheared(lost, EVERY, inside, BOTH, -steep)[0, :, :, 0]
    expected, middle = truth[SY // 2, SX // 2], np.s_[4:-4, 4:-4]
    assert np.abs(found - expected)[middle].max() < 0.15
    assert np.abs(wrong - expected)[middle].max() > 0.5


def test_lenses_without_foreground_stay_as_they_are():
    alpha = np.ones((SY, SX, SIDE, SIDE, 1), np.float32)
    alpha[:, :4] = 0
    low = light_field(0.1 * texture((1, 1)), alpha=alpha)
    low.noisy[:, :4] = 5.0
    image, _, ready = recovered(low)
    assert not ready.lost[:, :4].any() and ready.lost[:, 5:].any()
    np.testing.assert_allclose(image.reshape(SY, SX, -1)[:, :4], 0.5, atol=1e-6)
    # What such a lens shows has no say in the others.
    low.noisy[:, :4] = 0.0
    np.testing.assert_array_equal(recovered(low)[0], image)


def test_blocks_see_nothing_of_each_other():
    """Squares of lenses from anywhere give the same detail whatever lies beside them."""
    side, blocks = 5, [0.1 * texture((1, 1), seed, 5, 5) for seed in range(4)]

    def of(order):
        rows = [np.concatenate([blocks[n] for n in order[start:start + 2]], 1) for start in (0, 2)]
        low = light_field(np.concatenate(rows, 0))
        low.noisy[:] = decode(np.float32(0.5) + np.concatenate(rows, 0)[..., None])
        return Recovering("linear", side).prepare(low).lost

    one, other = of([0, 1, 2, 3]), of([3, 2, 1, 0])
    np.testing.assert_array_equal(one[:side, :side], other[side:, side:])
    np.testing.assert_array_equal(one[side:, :side], other[:side, side:])
    assert one.any((2, 3, 4)).all()


def test_a_firefly_is_no_detail():
    low = light_field(np.zeros((SY, SX, SIDE, SIDE), np.float32))
    low.noisy[4, 5, 3, 3] = 1e4
    image, *_ = recovered(low)
    assert np.abs(image - 0.5).max() < 0.01


@pytest.mark.parametrize("kernel", ["nearest", "bilinear", "bicubic", "lanczos"])
def test_where_nothing_was_lost_the_upscaler_has_its_way(kernel):
    color = np.random.default_rng(3).random((3, 4, SIDE, SIDE, 3), np.float32)
    low = LowResEIA(color, np.ones((3, 4, SIDE, SIDE, 1), np.float32), 16, SCALE)
    lenses = np.argwhere(np.ones((3, 4), bool))
    weights = METHODS[kernel].make().kernel
    expected = interpolated(encode(color).reshape(-1, SIDE, SIDE, 3), weights, BOTH)
    np.testing.assert_allclose(decode(expected), METHODS[kernel].make()(low, lenses), atol=2e-5)
    mean = averaged(encode(color), weights, BOTH).reshape(-1, SIDE, SIDE, 3)
    np.testing.assert_allclose(mean, expected.reshape(-1, SIDE, SCALE, SIDE, SCALE, 3).mean((2, 4)), atol=1e-5)


def test_at_full_resolution_too():
    low = dataclasses.replace(light_field(0.1 * texture((1, 1))), scale=1)
    chosen = load_method("none+epi")
    image = chosen.upscaler(chosen.prepare(low), np.argwhere(EVERY))
    error = np.mean((encode(image).reshape(low.color.shape) - 0.5 - 0.1 * texture((1, 1))[..., None]) ** 2)
    assert error < 0.1**2 / 4


def test_a_lens_alone_and_none_are_no_error():
    one = LowResEIA(*(np.ones((1, 1, SIDE, SIDE, channels), np.float32) for channels in (3, 1)), 16, SCALE)
    image, recovering, ready = recovered(one)
    assert image.shape == (1, SIDE * SCALE, SIDE * SCALE, 3)
    assert recovering(ready, np.zeros((0, 2), int)).shape == (0, SIDE * SCALE, SIDE * SCALE, 3)
    empty = dataclasses.replace(one, alpha=np.zeros_like(one.alpha))
    assert np.isfinite(recovered(empty)[0]).all()
