"""The whole comparison on a lenticular panel, its renders played: measured, stored, shown."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lfsr_core.base.records import read_record
from lfsr_lab.experiments.displays import study as run
from lfsr_lab.experiments.displays.measure import (
    OURS,
    SUBPIXEL,
    WAYS,
    Accuracy,
    Point,
    Target,
    Way,
    clean_guides,
    seen,
    shown,
)
from lfsr_lab.experiments.engine.renders import Store
from tests.support.panels import whole
from tests.support.played_blender import played_blender
from tests.support.synthetic import light_field, write_reference

PANEL = whole("lenticular")


def point(way: Way, cpu: float, ssim: float) -> Point:
    return Point(way.name, 4, cpu / 2, cpu / 2, Accuracy(30.0, None, ssim))


def accuracy(target: Target, panel: np.ndarray) -> Accuracy:
    return target.accuracy(panel, seen(panel, target.profile))


@pytest.fixture
def one_kind(monkeypatch):
    monkeypatch.setattr(run, "FULL_WIDTH", {"lenticular": 128})
    monkeypatch.setattr(run, "kind", lambda name, width: PANEL)


def test_everything_is_measured_once_and_shown(tmp_path, one_kind):
    scene = tmp_path / "disc.blend"
    scene.touch()
    blender = tmp_path / "blender"
    store = Store(tmp_path / "out", played_blender(blender))
    found = run.compare(store, None, 256, [scene])
    points = {(of.way, of.samples): of for of in found.rows[0].points}
    assert {way for way, _ in points} == {way.name for way in WAYS} and len(points) == 10
    assert points[OURS.name, 64].accuracy.ssim_eye > points[OURS.name, 4].accuracy.ssim_eye > 0.5
    assert points[SUBPIXEL.name, 16].traced.ssim_eye > points[SUBPIXEL.name, 1].traced.ssim_eye > 0.5
    assert points[SUBPIXEL.name, 16].traced.psnr_panel > points[SUBPIXEL.name, 16].accuracy.psnr_panel, "at home there"
    assert (points[OURS.name, 4].scale, points[SUBPIXEL.name, 4].scale) == (2, 1)
    assert all(of.finish_cpu > 0 and of.render_cpu >= 0 for of in points.values())
    blender.unlink()
    assert run.compare(store, None, 256, [scene]).rows == found.rows
    _, table, *images = run.write_pages(store.folder, found)
    assert table.read_text().count("| disc |") == 2 * 7 + 10
    assert len(images) == 2 and all("<svg" in image.read_text() for image in images)
    assert read_record(store.folder / "displays.json", run.Comparison, "a comparison").rows == found.rows


def test_the_reference_itself_is_perfect_and_less_views_are_not(tmp_path):
    target = Target.of(write_reference(tmp_path, noise=0.02, display=PANEL))
    field = light_field(PANEL)[..., :3]
    perfect = accuracy(target, shown(field, PANEL, "all"))
    assert perfect.ssim_eye > 0.99 and (perfect.psnr_panel or 99) > 45
    coarse = field.reshape(96, 16, 8, 3)[:, :, [1, 1, 1, 1, 6, 6, 6, 6]].reshape(field.shape)
    worse = accuracy(target, shown(coarse, PANEL, "all"))
    assert worse.ssim_eye < perfect.ssim_eye and worse.psnr_eye < (perfect.psnr_eye or 99)


def test_time_for_an_accuracy_lies_between_those_of_two_points():
    points = (point(OURS, 1.0, 0.8), point(OURS, 4.0, 0.9))
    assert run.seconds_for(points, 0.85) == pytest.approx(2.0)
    assert run.seconds_for(points, 0.7) == 1.0
    assert run.seconds_for(points, 0.95) is None


def test_nearest_views_are_woven_without_mixing():
    light = np.zeros((96, 128, 3), np.float32)
    light[:, 4:8] = 1.0
    assert set(np.unique(shown(light, PANEL, "nearest"))) <= {0, 255}


def test_cleaned_normals_keep_their_direction():
    normal = np.zeros((64, 64, 3), np.float32) + np.float32([0, 0, 1])
    normal[:, 32:] = [-1, 0, 0]
    noisy = normal + np.random.default_rng(0).normal(0, 0.2, normal.shape).astype(np.float32)
    cleaned = clean_guides({"normal": noisy})["normal"]
    assert np.abs(cleaned - normal).mean() < 0.5 * np.abs(noisy - normal).mean()


def test_the_published_comparison_is_read():
    published = Path(__file__).parents[4] / "docs" / "results" / "measured" / "displays.json"
    assert read_record(published, run.Comparison, "a comparison").rows[-1].points
