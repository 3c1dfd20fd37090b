"""Blocks and mosaics of sampled lenses, strata, and the budget that says how many."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.optics.display import load_display
from lfsr_core.plan.candidates import candidates
from lfsr_core.plan.sample import (
    LEAST_LENSES,
    LEAST_OF_STRATUM,
    MOST_LENSES,
    REACH_IN_A_VIEW,
    Mosaic,
    budget,
    looks,
    reach,
    samples,
    strata_masks,
    with_neighbours,
)
from tests.support.synthetic import MINI

GRID = (7, 5)
lens_lists = st.lists(st.tuples(st.integers(0, 4), st.integers(0, 6)), min_size=1, max_size=20, unique=True)


def numbered(listed: list[tuple[int, int]]) -> LowResEIA:
    """A render of ``listed`` lenses as one row of tiles, each filled with its lens's number."""
    numbers = np.array([row * GRID[0] + column for row, column in listed], np.float32)
    color = np.broadcast_to(numbers[None, :, None, None, None], (1, len(listed), 2, 2, 3))
    return LowResEIA(color, color[..., :1] / 100, 4, 2, position=color)


@given(lens_lists, st.integers(0, 2))
def test_mosaic_shows_each_sampled_lens_amid_its_neighbours(lenses, reach_):
    listed, blocks = with_neighbours(lenses, reach_, GRID)
    assert len(listed) == len(set(listed))
    mosaic = Mosaic.of(blocks)
    low = mosaic.of_render(numbered(listed))
    assert low.color.shape[:2] == mosaic.index.shape and low.position.shape == low.color.shape
    for (row, column), (y, x) in zip(lenses, mosaic.centres, strict=True):
        for down in range(-reach_, reach_ + 1):
            for right in range(-reach_, reach_ + 1):
                neighbour = np.clip(row + down, 0, 4) * GRID[0] + np.clip(column + right, 0, 6)
                assert low.color[y + down, x + right, 0, 0, 0] == neighbour


@given(lens_lists)
def test_mask_of_a_mosaic_is_that_of_its_centres(lenses):
    listed, blocks = with_neighbours(lenses, 1, GRID)
    tiles = np.array([(row + column) % 2 == 0 for row, column in listed])[None]
    assert Mosaic.of(blocks).of_mask(tiles).tolist() == [(row + column) % 2 == 0 for row, column in lenses]


@given(st.integers(4, 60), st.integers(0, 99), st.booleans())
def test_sample_is_of_its_strata_and_no_lens_comes_twice(count, seed, whole):
    mask, wide = np.zeros((12, 16), bool), np.zeros((12, 16), bool)
    mask[3:9, 4:12], wide[2:10, 3:13] = True, True
    masks = strata_masks(mask, wide)
    assert sum(m.astype(int) for m in masks.values()).min() == 1 == sum(m.astype(int) for m in masks.values()).max()
    (found,) = samples(masks, (count,), seed, whole)
    for name, lenses in found.items():
        assert len(set(lenses)) == len(lenses) and all(masks[name][lens] for lens in lenses)
        assert len(lenses) >= LEAST_OF_STRATUM or (name == "rest" and not whole)
    assert [found] == samples(masks, (count,), seed, whole)
    assert sum(map(len, found.values())) <= max(count, 3 * LEAST_OF_STRATUM)
    # A sample that grows begins with the same lenses, and adds others.
    first, *more = samples(masks, (count, 2 * count, 4 * count), seed, whole)
    assert first == found
    for name in found:
        every = [lens for added in (first, *more) for lens in added[name]]
        assert len(set(every)) == len(every) and all(masks[name][lens] for lens in every)
    assert all(any(added.values()) for added in more)


@given(st.integers(LEAST_LENSES, MOST_LENSES))
def test_each_look_about_doubles_the_lenses(most):
    counts = looks(LEAST_LENSES, most)
    assert counts[-1] == most and counts[0] in (LEAST_LENSES, most)
    assert all(1.4 < later / earlier < 2.9 for earlier, later in itertools.pairwise(counts))
    assert looks(LEAST_LENSES, 192) == (12, 24, 48, 96, 192)


def test_neighbours_are_as_many_as_a_denoiser_needs():
    display = load_display("bupt-32in-8k")
    assert [reach(display, scale) for scale in (1, 2, 4, 8)] == [0, 0, 1, 2]
    lenticular = load_display("looking-glass-16")
    # A pixel of a view is a lens, at every scale.
    assert [reach(lenticular, scale) for scale in (1, 2, 4)] == [REACH_IN_A_VIEW] * 3


@given(st.floats(0.001, 1), st.floats(1, 8))
def test_sample_stays_within_its_budget(fraction, ratio):
    display = load_display("bupt-32in-8k")
    found = budget(display, candidates(display), 256, 1e6, ratio, fraction)
    assert LEAST_LENSES <= found.lenses <= MOST_LENSES
    usual = [key for key, cost in found.renders.items() if cost < found.reference]
    if found.lenses > LEAST_LENSES:
        assert found.quick + found.cost(found.lenses, usual) <= found.allowed
    assert budget(display, candidates(display), 256, 1e6, 2 * ratio, fraction).lenses <= found.lenses


def test_cost_of_a_sample_counts_every_render_and_neighbour():
    found = budget(MINI, candidates(MINI, (2,), (4,), ("bilinear",)), 16, 1000.0, 3.0, 0.05)
    assert found.allowed == pytest.approx(0.05 * 64 * 48 * 4)
    assert found.cost(10, [(2, 4)]) == 10 * 3 * (64 * 16 + 25 * 16 * 4)
    assert found.cost(10, [(2, 4)], reference=False) == 10 * 3 * 25 * 16 * 4
    assert budget(MINI, candidates(MINI, (2,), (4,), ("bilinear",)), 16, 1000.0, 3.0, 0.05, 1e6).allowed == 1e6
