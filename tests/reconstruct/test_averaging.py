"""Frames of an animation are averaged where they differ by their noise alone, and nowhere else."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.reconstruct.averaging import average_frames, similarity, unchanged

SHAPE = (10, 12, 4, 5, 3)
BLOCK = (slice(2, 6), slice(3, 8))  # lenses in which something moves


def waves(phase: float, shape: tuple[int, ...] = SHAPE) -> np.ndarray:
    """A smooth light field: each lens shows waves that its neighbours see a little farther on."""
    y, x, v, u, c = np.meshgrid(*map(np.arange, shape), indexing="ij")
    return (0.5 + 0.4 * np.sin(0.9 * x + 0.7 * y + 0.5 * u - 0.4 * v + c + phase)).astype(np.float32)


def frame(clean: np.ndarray, seed: int, noise: float = 0.3, **layers: np.ndarray) -> LowResEIA:
    """A render of ``clean`` with the skewed noise of path tracing, equal in all channels."""
    grain = np.random.default_rng(seed).gamma(1 / noise**2, noise**2, (*clean.shape[:-1], 1))
    return LowResEIA((clean * grain).astype(np.float32), np.ones((*clean.shape[:-1], 1), np.float32), 16, 4, **layers)


def deviation(low: LowResEIA, clean: np.ndarray) -> float:
    return float(np.std(low.color - clean))


@pytest.mark.parametrize("count", [2, 5])
@pytest.mark.parametrize("noise", [0.1, 0.5, 1.5])
def test_the_noise_of_a_static_scene_goes_down_by_the_root_of_the_frames(count, noise):
    clean = waves(0)
    frames = [frame(clean, seed, noise) for seed in range(count)]
    ratio = deviation(average_frames(frames[0], frames[1:])[0], clean) / deviation(frames[0], clean)
    assert ratio == pytest.approx(count**-0.5, rel=0.1)


def test_the_mean_is_kept():
    clean = waves(0)
    averaged, _ = average_frames(frame(clean, 0), [frame(clean, seed) for seed in range(1, 5)])
    assert averaged.color.mean() == pytest.approx(clean.mean(), rel=0.01)
    assert averaged.color.dtype == np.float32 and averaged.samples == 16


def test_what_moved_is_untouched_and_the_rest_averaged():
    clean, moved = waves(0), waves(0)
    moved[BLOCK] = waves(2.0)[BLOCK]
    ours, other = frame(clean, 0, 0.1), frame(moved, 1, 0.1)
    weight = similarity(ours, other)
    assert weight[BLOCK].mean() < 0.05 and weight[:, 10:].mean() > 0.9
    averaged, _ = average_frames(ours, [other] * 4)
    assert np.abs(averaged.color - ours.color)[BLOCK].mean() < 0.2 * np.abs(other.color - ours.color)[BLOCK].mean()


@pytest.mark.parametrize("noise", [0.1, 0.5, 1.0])
def test_a_figure_that_moved_far_leaves_no_trace(noise):
    """Before black: its lenses keep their own pixels, and black ones stay black."""
    here, there = (np.zeros((*SHAPE[:4], 1), np.float32) for _ in range(2))
    here[BLOCK] = there[BLOCK[0], 9:] = 1
    ours, other = (dataclasses.replace(frame(waves(phase) * alpha, seed, noise), alpha=alpha)
                   for seed, (phase, alpha) in enumerate([(0, here), (2.0, there)]))
    averaged, fraction = average_frames(ours, [other] * 4)
    np.testing.assert_array_equal(averaged.color, ours.color)
    assert fraction == 0


def test_the_fraction_is_how_much_of_what_a_frame_shows_was_averaged():
    clean, moved = waves(0), waves(0)
    moved[:, 6:] = waves(2.0)[:, 6:]
    shown = np.ones((*SHAPE[:4], 1), np.float32)
    shown[5:] = 0
    ours, other = (dataclasses.replace(frame(image * shown, seed, 0.1), alpha=shown)
                   for seed, image in enumerate((clean, moved)))
    assert average_frames(ours, [other] * 2)[1] == pytest.approx(5 / 12, abs=0.05), "a lens beside a change too"


def test_what_moved_in_opacity_alone_is_untouched():
    clean = waves(0)
    flat = np.full(SHAPE, 0.5, np.float32)
    other = flat.copy()
    other[BLOCK] = 0.9
    weight = similarity(frame(clean, 0, opacity=flat), frame(clean, 1, opacity=other))
    assert weight[BLOCK].max() < 0.05 and weight[:, 10:].mean() > 0.9


@pytest.mark.parametrize("times", [0.7, 1.2])
def test_light_that_changed_without_anything_moving_is_detected(times):
    clean = waves(0)
    assert similarity(frame(clean, 0), frame(clean * np.float32(times), 1)).mean() < 0.2


def test_a_reflection_that_moved_is_detected():
    """Inside elemental images, in a few lenses, with the mean light as it was."""
    clean, moved = waves(0), waves(0)
    moved[BLOCK] = clean[BLOCK][..., ::-1, :]
    assert similarity(frame(clean, 0, 0.1), frame(moved, 1, 0.1))[BLOCK].mean() < 0.1


def test_similarity_is_symmetrical_and_within_bounds():
    ours, other = frame(waves(0), 0), frame(waves(0.3), 1)
    weight = similarity(ours, other)
    np.testing.assert_allclose(weight, similarity(other, ours), rtol=1e-5)
    assert weight.shape == SHAPE[:2] and weight.min() >= 0 and weight.max() <= 1


def test_equal_frames_are_averaged_everywhere_and_dark_ones_too():
    assert unchanged(np.zeros(SHAPE, np.float32)).min() == 1
    black = frame(np.zeros(SHAPE, np.float32), 0)
    assert not average_frames(black, [black])[0].color.any()


@pytest.mark.parametrize("shape", [(1, 1, 1, 1, 3), (48, 16, 1, 4, 3), (3, 2, 2, 2, 3)])
def test_few_lenses_and_views_along_one_axis(shape):
    clean = np.full(shape, 0.5, np.float32)
    averaged, _ = average_frames(frame(clean, 0), [frame(clean, seed) for seed in (1, 2)])
    assert averaged.color.shape == shape and np.isfinite(averaged.color).all()


def test_without_neighbours_nothing_changes():
    low = frame(waves(0), 0)
    np.testing.assert_array_equal(average_frames(low, [])[0].color, low.color)
    assert average_frames(low, [])[1] == 0


def test_opacity_is_averaged_like_colour():
    clean = waves(0)
    noisy = [frame(clean, seed, opacity=frame(clean, seed + 20).color) for seed in range(4)]
    averaged, _ = average_frames(noisy[0], noisy[1:])
    assert np.std(averaged.opacity - clean) < 0.6 * np.std(noisy[0].opacity - clean)
    assert dataclasses.replace(noisy[0], color=averaged.color).samples == 16
