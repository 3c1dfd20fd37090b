import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lfsr_core.reconstruct.methods.rectangles import rectangles, span

VIEWS = (16, 16)  # two lenses of context


def lenses(*places, shape=(20, 30)):
    wanted = np.zeros(shape, bool)
    for place in places:
        wanted[place] = True
    return wanted


def test_one_group_is_one_tight_rectangle_with_context():
    (found,) = rectangles(lenses((8, 9), (10, 12)), VIEWS)
    assert found.inner == (slice(8, 11), slice(9, 13)) and found.outer == (slice(6, 13), slice(7, 15))
    assert found.crop == (slice(2, 5), slice(2, 6))


def test_groups_far_apart_are_rectangles_of_their_own():
    wanted = lenses((1, 1), (1, 20), (15, 3))
    assert [found.inner for found in rectangles(wanted, VIEWS)] == [
        (slice(1, 2), slice(1, 2)), (slice(1, 2), slice(20, 21)), (slice(15, 16), slice(3, 4))]
    assert len(rectangles(lenses((1, 1), (1, 5)), VIEWS)) == 1, "near ones share their context"


def test_nothing_wanted_is_no_rectangle():
    assert rectangles(lenses(), VIEWS) == [] and rectangles(np.zeros((0, 0), bool), VIEWS) == []
    assert span(np.zeros(5, bool), 8) == slice(0, 0)


@given(st.integers(0, 2 ** 32 - 1), st.floats(0, 0.3), st.sampled_from([(10, 20), (16, 16), (1, 1)]))
def test_every_wanted_lens_lies_in_one_rectangle(seed, share, views):
    wanted = np.random.default_rng(seed).random((17, 23)) < share
    count = np.zeros(wanted.shape, int)
    for found in rectangles(wanted, views):
        count[found.inner] += 1
        assert wanted[found.inner].any()
        rows, columns = found.outer
        np.testing.assert_array_equal(np.arange(17)[rows][found.crop[0]], np.arange(17)[found.inner[0]])
        np.testing.assert_array_equal(np.arange(23)[columns][found.crop[1]], np.arange(23)[found.inner[1]])
    assert count.max(initial=0) <= 1 and (count[wanted] == 1).all()


@pytest.mark.parametrize("pixels", [4, 10, 20, 32])
def test_a_rectangle_begins_where_the_library_pools(pixels):
    for first in range(20):
        assert span(lenses((0, first))[0], pixels).start * pixels % 16 == 0
