"""Blocks and mosaics of sampled lenses, and how many are sampled."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfsr_core.base.notices import Notice, Progress
from lfsr_core.frames.low_res import LowResEIA
from lfsr_core.metrics.split_ssim import stacked_ssim
from lfsr_core.optics.display import load_display
from lfsr_core.plan import planner as plan_sample
from lfsr_core.plan.options import PlanOptions
from lfsr_core.plan.planner import (
    LEAST_LENSES,
    REACH_IN_A_VIEW,
    USUAL_LENSES,
    Mosaic,
    SampleRenders,
    lens_count,
    reach,
    sampled_lenses,
    split_scores,
    with_neighbours,
)
from tests.support.noisy_renders import JOB, render
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


@given(st.integers(4, 60), st.integers(0, 9))
def test_sampled_lenses_are_different_ones_of_the_mask(count, seed):
    mask = np.zeros((12, 16), bool)
    mask[3:8, 4:11] = True
    found = sampled_lenses(mask, count, seed)
    assert len(set(found)) == len(found) == min(count, 35) and all(mask[lens] for lens in found)
    assert found == sampled_lenses(mask, count, seed)


def test_neighbours_are_as_many_as_a_denoiser_needs():
    display = load_display("bupt-32in-8k")
    assert [reach(display, scale) for scale in (1, 2, 4, 8)] == [0, 0, 1, 2]
    lenticular = load_display("looking-glass-16")
    # A pixel of a view is a lens, at every scale.
    assert [reach(lenticular, scale) for scale in (1, 2, 4)] == [REACH_IN_A_VIEW] * 3
    display, options = load_display("bupt-32in-8k"), PlanOptions()
    counts = [lens_count(display, dataclasses.replace(options, budget=budget)) for budget in (0.0001, 0.01, 1.0)]
    assert counts == sorted(counts) and counts[0] >= LEAST_LENSES and counts[-1] == USUAL_LENSES
    assert lens_count(display, dataclasses.replace(options, lenses=300)) == 300


def test_progress_of_a_render_moves_that_of_the_plan(tmp_path):
    told = []

    def telling(request, tell):
        for fraction in (0.0, 0.5, 1.0):
            tell(Progress("render", fraction, "Sample"))
        tell(Notice("subject-unseen"))
        render(request)
    renders = SampleRenders(tmp_path, JOB, telling, told.append)
    renders.whole = 4 * 64 * 48
    renders.sampled(2, 1, [(0, 0), (5, 5)], 2)
    renders.quick()
    assert Notice("subject-unseen") in told
    fractions = [each.fraction for each in told if isinstance(each, Progress)]
    assert fractions == sorted(fractions) and fractions[-1] == pytest.approx(
        (2 * 16 + 4 * math.prod(MINI.lenses) * 4) / renders.whole)


def test_correction_takes_some_of_the_references_noise_out(monkeypatch):
    monkeypatch.setattr(plan_sample, "srgb_encode", lambda image: image)  # noise that is normal in display values
    random, noise = np.random.default_rng(0), 0.08
    exact = np.full((300, 24, 24, 1), 0.5)
    exact[:, :, 12:] += 0.2 * np.sin(np.arange(12) / 1.7)[:, None]
    image = exact + random.normal(0, 0.015, exact.shape)
    true = float(stacked_ssim(image, exact, exact).mean())
    quarters = [exact + random.normal(0, noise, exact.shape) for _ in range(4)]
    plain = float(stacked_ssim(image, *(np.mean(quarters[half], 0) for half in (np.s_[:2], np.s_[2:]))).mean())
    corrected = float(split_scores(image, quarters).mean())
    assert plain < true - 0.003 and abs(corrected - true) < abs(plain - true)
