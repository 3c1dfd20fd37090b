"""Frames of an animation are averaged where they differ by their noise alone, and nowhere else."""

import dataclasses

import numpy as np
import pytest

from lfsr_core.base.messages import Notice
from lfsr_core.frames.frame import Finish, read_frame
from lfsr_core.reconstruct import averaging
from lfsr_core.reconstruct.averaging import average_frames, near, neighbours_of, similarity
from lfsr_core.reconstruct.second_stage import finish_frame
from lfsr_core.reconstruct.upscaler import LowResEIA
from tests.support.synthetic import IDENTITY, write_render

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
    averaged, _ = average_frames(frames[0], frames[1:])
    assert deviation(averaged, clean) / deviation(frames[0], clean) == pytest.approx(count**-0.5, rel=0.1)
    assert averaged.color.mean() == pytest.approx(clean.mean(), rel=0.01 if noise < 1 else 0.03)
    assert averaged.color.dtype == np.float32 and averaged.samples == 16


def test_what_moved_is_untouched_and_the_fraction_is_of_what_was_averaged():
    clean, moved = waves(0), waves(0)
    moved[BLOCK] = waves(2.0)[BLOCK]
    ours, other = frame(clean, 0, 0.1), frame(moved, 1, 0.1)
    weight = similarity(ours, other)
    assert weight[BLOCK].mean() < 0.05 and weight[:, 10:].mean() > 0.9
    averaged, _ = average_frames(ours, [other] * 4)
    assert np.abs(averaged.color - ours.color)[BLOCK].mean() < 0.2 * np.abs(other.color - ours.color)[BLOCK].mean()
    clean, moved = waves(0), waves(0)
    moved[:, 6:] = waves(2.0)[:, 6:]
    shown = np.ones((*SHAPE[:4], 1), np.float32)
    shown[5:] = 0
    ours, other = (dataclasses.replace(frame(image * shown, seed, 0.1), alpha=shown)
                   for seed, image in enumerate((clean, moved)))
    assert average_frames(ours, [other] * 2)[1] == pytest.approx(5 / 12, abs=0.05), "a lens beside a change too"


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


def test_what_moved_in_opacity_alone_or_in_a_reflection_is_detected():
    clean, flat = waves(0), np.full(SHAPE, 0.5, np.float32)
    other = flat.copy()
    other[BLOCK] = 0.9
    weight = similarity(frame(clean, 0, opacity=flat), frame(clean, 1, opacity=other))
    assert weight[BLOCK].max() < 0.05 and weight[:, 10:].mean() > 0.9
    noisy = [frame(clean, seed, opacity=frame(clean, seed + 20).color) for seed in range(4)]
    averaged, _ = average_frames(noisy[0], noisy[1:])
    assert np.std(averaged.opacity - clean) < 0.6 * np.std(noisy[0].opacity - clean)
    moved = clean.copy()
    moved[BLOCK] = clean[BLOCK][..., ::-1, :]
    assert similarity(frame(clean, 0, 0.1), frame(moved, 1, 0.1))[BLOCK].mean() < 0.1
    for times in [0.7, 1.2]:
        assert similarity(frame(clean, 0), frame(clean * np.float32(times), 1)).mean() < 0.2


def test_similarity_is_symmetrical_within_bounds_and_whole_for_equal_few_and_dark_lenses():
    ours, other = frame(waves(0), 0), frame(waves(0.3), 1)
    weight = similarity(ours, other)
    np.testing.assert_allclose(weight, similarity(other, ours), rtol=1e-5)
    assert weight.shape == SHAPE[:2] and weight.min() >= 0 and weight.max() <= 1
    assert averaging.unchanged(np.zeros(SHAPE, np.float32)).min() == 1
    black = frame(np.zeros(SHAPE, np.float32), 0)
    assert not average_frames(black, [black])[0].color.any()
    np.testing.assert_array_equal(average_frames(ours, [])[0].color, ours.color)
    assert average_frames(ours, [])[1] == 0
    for shape in [(1, 1, 1, 1, 3), (48, 16, 1, 4, 3), (3, 2, 2, 2, 3)]:
        clean = np.full(shape, 0.5, np.float32)
        averaged, _ = average_frames(frame(clean, 0), [frame(clean, seed) for seed in (1, 2)])
        assert averaged.color.shape == shape and np.isfinite(averaged.color).all()


def film(folder, numbers, **changes):
    for number in numbers:
        frame = folder / f"{number:04d}"
        frame.mkdir(exist_ok=True)
        write_render(frame, frame=number, **{"seed": number} | changes)
    return folder


def numbers_near(folder, number, count):
    frame = folder / f"{number:04d}"
    return [(neighbour.number, neighbour.same_rays and not neighbour.same_seed)
            for neighbour in neighbours_of(frame, read_frame(frame), count)]


def test_only_the_nearest_rendered_frames_with_a_number_on_both_sides_count(tmp_path):
    assert near(5, [1, 2, 4, 5, 7, 9, 11], 2) == [2, 4, 7, 9]
    assert near(1, [1, 2, 3, 4, 5, 6], 2) == [2, 3, 4, 5] and near(6, range(1, 7), 2) == [2, 3, 4, 5]
    assert near(1, [1, 2, 3], 2) == [2, 3] and near(1, [1, 2, 3], 0) == []
    film(tmp_path, (1, 3))
    (tmp_path / "0002").mkdir()
    write_render(tmp_path / "0001", frame=1, seed=1).rename(tmp_path / "notes")
    notes = tmp_path / "notes"
    assert numbers_near(tmp_path, 3, 1) == [] and not neighbours_of(notes, read_frame(notes), 1)


def test_the_second_stage_averages_with_which_array_stood_still_and_says_so(tmp_path):
    film(tmp_path, (1, 2, 3))
    report = finish_frame(tmp_path / "0002", Finish("bicubic", temporal_averaging=1))
    assert report.neighbours == (1, 3) and report.seconds["average"] >= 0
    assert report.averaged == 1, "the frames are the same"
    alone = finish_frame(tmp_path / "0002", "bicubic")
    assert (alone.neighbours, alone.averaged) == ((), None) and "average" not in alone.seconds
    film(tmp_path, (1, 2, 3))
    film(tmp_path, (4,), seed=3)
    film(tmp_path, (1,), matrix_world=tuple((*row[:3], row[3] + 0.01) for row in IDENTITY[:3]) + IDENTITY[3:])
    assert numbers_near(tmp_path, 3, 2) == [(1, False), (2, True), (4, False)]
    neighbours = neighbours_of(tmp_path / "0003", read_frame(tmp_path / "0003"), 2)
    notes = averaging.averaging_notices(neighbours)
    assert notes == [Notice("averaging-same-seed", {"frames": [4]}), Notice("averaging-other-rays", {"frames": [1]})]
    assert not averaging.averaging_notices(neighbours[1:2])
