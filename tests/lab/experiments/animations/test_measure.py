"""Flicker, drift and lag of animations: each shows what it is named after, and none the reference's noise."""

import re
from pathlib import Path

import numpy as np
import pytest

from lfsr_core.base.records import read_record
from lfsr_core.cli import main
from lfsr_lab.experiments.animations import study
from lfsr_lab.experiments.engine.plots import svg
from lfsr_lab.experiments.engine.records import Store

FRAMES, LENSES, SIDE = 5, 30, 12
RANDOM = np.random.default_rng(3)


def clean() -> np.ndarray:
    """Elemental images of waves whose light gets stronger from frame to frame."""
    t, n, y, x, c = np.meshgrid(*map(np.arange, (FRAMES, LENSES, SIDE, SIDE, 3)), indexing="ij")
    return 0.5 + 0.2 * np.sin(0.6 * x + 0.4 * y + n + c) + 0.03 * t


def noise(size: float) -> np.ndarray:
    return RANDOM.normal(0, size, (FRAMES, LENSES, SIDE, SIDE, 3))


HALVES = clean() + noise(0.05), clean() + noise(0.05)


def late(fraction):
    """Frames whose light is that of ``fraction`` of a frame before."""
    return (1 - fraction) * clean() + fraction * np.concatenate([clean()[:1], clean()[:-1]])


@pytest.mark.parametrize(("image", "expected"), [
    (lambda: clean(), {"ssim": (1, 0.03), "flicker": (0, 0.7), "offset": (0, 0.15), "lag": (0, 0.03)}),
    (lambda: clean(), {"change": (1, 0.05)}),
    (lambda: clean() + noise(0.1), {"flicker": (100 * 0.1 * 2**0.5, 0.7), "change": (4.82, 0.1)}),  # its own in each
    (lambda: clean() + noise(0.1)[:1], {"flicker": (0, 0.7)}),  # that stands
    (lambda: clean() + 0.04, {"offset": (4, 0.12), "flicker": (0, 0.7)}),  # a low-frequency error
    (lambda: late(1), {"lag": (1, 0.05)}), (lambda: late(0.5), {"lag": (0.5, 0.05)})])
def test_each_figure_shows_what_it_is_named_after(image, expected):
    figures = study.compare(image(), *HALVES)
    for name, (value, allowed) in expected.items():
        assert getattr(figures, name) == pytest.approx(value, abs=allowed), name


def test_renders_differ_by_their_seeds_references_share_none_and_the_cost_is_said_in_seconds(tmp_path, capsys):
    animation = study.Animation(Store(tmp_path), study.Settings(), "object")
    assert len({job.seed for job in animation.low(study.FIXED, 4)}) == 1
    assert len({job.seed for job in animation.low(study.CHANGING, 4)}) == study.Settings().frames
    lenses = study.Settings().lens_list
    assert len(set(lenses)) == study.Settings().reference_lenses and study.Settings(seed=1).lens_list != lenses
    assert main(["study", "animations", "--cost", "mini"]) == 0
    assert "CPU seconds per neighbouring frame" in capsys.readouterr().out
    assert main(["study", "animations", "--cost", "nothing"]) == 2


def test_tables_and_chart_show_every_figure_of_a_report():
    rows = tuple(study.Row("object", way.name, spp, study.Motion(0.9, 1.0, 0.5, 0.25, 0.1, 1.1))
                 for way in (study.FIXED_ALONE, study.ALONE, study.AVERAGED) for spp in (4, 16))
    assert f"| {study.ALONE.name} | 4 | 0.9000 | 1.00 | 0.50 | 0.25 | 1.10 |" in study.markdown(rows).splitlines()
    published = Path(__file__).parents[4] / "docs" / "results" / "measured" / "shots.json"
    kept = read_record(published, study.Report, "a report").rows
    assert {"a figure dances", "the light moves"} <= set(re.findall(r"[a-z ]+(?=: split)", svg(study.chart(kept))))
