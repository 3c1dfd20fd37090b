"""Which frames lie beside a frame, and which of them can be averaged with it."""

from __future__ import annotations

import numpy as np
import pytest

from lfsr_core.base.notices import Notice
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.frame import read_frame
from lfsr_core.pipeline.finishing import finish_frame
from lfsr_core.reconstruct.averaging import averaging_notices, near, neighbours_of, numbered_beside
from lfsr_core.reconstruct.second_stage import finished_linear
from tests.support.synthetic import IDENTITY, write_render


def film(folder, numbers, **changes):
    for number in numbers:
        frame = folder / f"{number:04d}"
        frame.mkdir(exist_ok=True)
        write_render(frame, frame=number, **{"seed": number} | changes)
    return folder


def numbers_near(folder, number, count):
    frame = folder / f"{number:04d}"
    return [(each.number, each.usable) for each in neighbours_of(frame, read_frame(frame), count)]


def test_the_nearest_on_both_sides():
    assert near(5, [1, 2, 4, 5, 7, 9, 11], 2) == [2, 4, 7, 9]
    assert near(1, [1, 2, 3, 4, 5, 6], 2) == [2, 3, 4, 5] and near(6, range(1, 7), 2) == [2, 3, 4, 5]
    assert near(1, [1, 2, 3], 2) == [2, 3]
    assert near(1, [1, 2, 3], 0) == []


@pytest.mark.parametrize("count", [1, 2, 4])
def test_frames_near_one_have_every_seed_once(count):
    numbers = range(-5, 20)
    for number in numbers:
        seeds = [Finish("bicubic", temporal_averaging=count).seed_of(7, each) for each in [number, *near(number,
                numbers, count)]]
        assert sorted(seeds) == list(range(7, 7 + 2 * count + 1))


def test_rendered_and_planned_frames_count(tmp_path):
    film(tmp_path, (1, 3))
    (tmp_path / "0002").mkdir()
    (tmp_path / "notes").mkdir()
    assert [path.name for path in numbered_beside(tmp_path / "0001", 1)] == ["0003"]
    assert [path.name for path in numbered_beside(tmp_path / "0001", 1, planned=[2])] == ["0002", "0003"]
    assert numbered_beside(tmp_path / "notes", 1) == []


def test_an_array_that_moved_or_the_same_seed_is_not_averaged(tmp_path):
    film(tmp_path, (1, 2, 3))
    film(tmp_path, (4,), seed=3)
    moved = tuple((*row[:3], row[3] + 0.01) for row in IDENTITY[:3]) + IDENTITY[3:]
    film(tmp_path, (1,), matrix_world=moved)
    assert numbers_near(tmp_path, 3, 2) == [(1, False), (2, True), (4, False)]
    found = neighbours_of(tmp_path / "0003", read_frame(tmp_path / "0003"), 2)
    notes = averaging_notices(found)
    assert notes == [Notice("averaging-same-seed", {"frames": [4]}), Notice("averaging-other-rays", {"frames": [1]})]
    assert not averaging_notices(found[1:2])


def test_the_second_stage_averages_and_says_with_which(tmp_path):
    film(tmp_path, (1, 2, 3))
    report = finish_frame(tmp_path / "0002", Finish("bicubic", temporal_averaging=1))
    assert report.neighbours == (1, 3) and report.seconds["average"] >= 0
    assert report.averaged == 1, "the frames are the same"
    alone = finish_frame(tmp_path / "0002", "bicubic")
    assert (alone.neighbours, alone.averaged) == ((), None)
    assert "average" not in alone.seconds


def test_frames_without_noise_are_finished_as_alone(tmp_path):
    film(tmp_path, (1, 2))
    images = [finished_linear(tmp_path / "0001", Finish("bicubic", temporal_averaging=count))
              for count in (0, 2)]
    np.testing.assert_allclose(*images, atol=1e-5)
