"""How frames are finished: what is refused, and the seeds of neighbouring frames."""

import pytest

from lfsr_core.base.records import from_data, to_data
from lfsr_core.frames.finish import MOST_AVERAGED, Finish
from tests.support.told import refuses


def test_a_finish_is_read_as_it_was_written():
    finish = Finish("bicubic", 2, "weights.tza", True, 1)
    assert from_data(Finish, to_data(finish), "finish") == finish and Finish.of("bicubic") == Finish("bicubic")


@pytest.mark.parametrize("options", [{"dilate": -1}, {"temporal_averaging": -1},
                                     {"temporal_averaging": MOST_AVERAGED + 1}, {"temporal_averaging": 10**400}])
def test_what_no_frame_can_be_finished_with_is_refused(options):
    refuses("", Finish, "bicubic", **options)


@pytest.mark.parametrize("count", range(MOST_AVERAGED + 1))
def test_frames_that_are_averaged_have_each_seed_once(count):
    finish, across = Finish("bicubic", temporal_averaging=count), 2 * count + 1
    for first in (-3, 1, 40):
        seeds = [finish.seed_of(5, frame) for frame in range(first, first + across)]
        assert sorted(seeds) == list(range(5, 5 + across))
    assert 0 <= finish.seed_of(2**31 - 1, 2) < 2**31
