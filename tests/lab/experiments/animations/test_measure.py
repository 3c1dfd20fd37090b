"""Flicker, drift and lag of animations: each shows what it is named after, and none the reference's noise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lfsr_core.base.records import read_record
from lfsr_core.cli import main
from lfsr_lab.experiments.animations import study
from lfsr_lab.experiments.engine.plots import svg
from lfsr_lab.experiments.engine.renders import Store

FRAMES, LENSES, SIDE = 5, 30, 12
RANDOM = np.random.default_rng(3)


def clean() -> np.ndarray:
    """Elemental images of waves whose light gets stronger from frame to frame."""
    t, n, y, x, c = np.meshgrid(*map(np.arange, (FRAMES, LENSES, SIDE, SIDE, 3)), indexing="ij")
    return 0.5 + 0.2 * np.sin(0.6 * x + 0.4 * y + n + c) + 0.03 * t


def noise(size: float) -> np.ndarray:
    return RANDOM.normal(0, size, (FRAMES, LENSES, SIDE, SIDE, 3))


HALVES = clean() + noise(0.05), clean() + noise(0.05)


def test_a_perfect_image_has_none_of_them():
    found = study.compare(clean(), *HALVES)
    assert found.ssim == pytest.approx(1, abs=0.03)
    assert found.flicker < 0.7 and found.offset < 0.15 and abs(found.lag) < 0.03


def test_noise_of_its_own_in_every_frame_flickers_and_noise_that_stands_does_not():
    assert study.compare(clean() + noise(0.1), *HALVES).flicker == pytest.approx(100 * 0.1 * 2**0.5, rel=0.05)
    assert study.compare(clean() + noise(0.1)[:1], *HALVES).flicker < 0.7


def test_a_wrong_brightness_is_a_low_frequency_error():
    found = study.compare(clean() + 0.04, *HALVES)
    assert found.offset == pytest.approx(4, rel=0.03) and found.flicker < 0.7


def test_an_image_of_the_frame_before_is_one_frame_late():
    late = clean()
    late[1:] = clean()[:-1]
    assert study.compare(late, *HALVES).lag == pytest.approx(1, abs=0.05)
    half = (clean() + late) / 2
    assert study.compare(half, *HALVES).lag == pytest.approx(0.5, abs=0.05)


def test_the_cost_command_says_seconds(capsys):
    assert main(["study", "animations", "--cost", "mini"]) == 0
    assert "CPU seconds per neighbouring frame" in capsys.readouterr().out
    assert main(["study", "animations", "--cost", "nothing"]) == 2


def test_renders_differ_by_their_seeds_and_references_share_none(tmp_path):
    animation = study.Animation(Store(tmp_path), study.Settings(), "object")
    assert len({job.seed for job in animation.low(study.FIXED, 4)}) == 1
    assert len({job.seed for job in animation.low(study.CHANGING, 4)}) == study.Settings().frames
    lenses = study.Settings().lens_list
    assert len(set(lenses)) == study.Settings().reference_lenses and study.Settings(seed=1).lens_list != lenses


def test_tables_and_chart_show_every_figure():
    found = tuple(study.Found("object", way.name, spp, study.Motion(0.9, 1.0, 0.5, 0.25, 0.1))
                  for way in (study.FIXED_ALONE, study.ALONE, study.AVERAGED) for spp in (4, 16))
    lines = study.markdown(found).splitlines()
    assert f"| {study.ALONE.name} | 4 | 0.9000 | 1.00 | 0.50 | 0.25 |" in lines
    assert "an object moves" in svg(study.chart(found))


def test_the_published_report_is_read_and_drawn():
    published = Path(__file__).parents[4] / "docs" / "results" / "measured" / "shots.json"
    found = read_record(published, study.Report, "a report").found
    assert "a figure dances" in svg(study.chart(found))
