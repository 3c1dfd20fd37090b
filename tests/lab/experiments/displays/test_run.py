"""Displays cut down to fewer pixels are the same displays; the comparison on one, its renders played."""

import math
from pathlib import Path

import numpy as np
import pytest

from lfsr_core.base.records import read_record
from lfsr_lab.experiments.displays import measure
from lfsr_lab.experiments.displays import study as run
from lfsr_lab.experiments.engine.records import Store
from tests.support.panels import whole
from tests.support.played_blender import played_blender
from tests.support.synthetic import light_field, write_reference
from tests.support.told import refuses

PANEL = whole("lenticular")


def test_everything_is_measured_once_and_shown(tmp_path, monkeypatch):
    monkeypatch.setattr(measure, "FULL_WIDTH", {"lenticular": 128})
    monkeypatch.setattr(measure, "kind", lambda name, width: PANEL)
    scene = tmp_path / "disc.blend"
    scene.touch()
    blender = tmp_path / "blender"
    store = Store(tmp_path / "out", played_blender(blender))
    comparison = run.compare(store, None, 256, [scene])
    points = {(of.way, of.samples): of for of in comparison.rows[0].points}
    assert {way for way, _ in points} == {way.name for way in measure.WAYS} and len(points) == 10
    ours, direct = ({samples: of for (name, samples), of in points.items() if name == way.name}
                    for way in (measure.OURS, measure.SUBPIXEL))
    assert ours[64].accuracy.ssim_eye > ours[4].accuracy.ssim_eye > 0.5
    assert direct[16].traced.ssim_eye > direct[1].traced.ssim_eye > 0.5
    assert direct[16].traced.psnr_panel > direct[16].accuracy.psnr_panel, "at home there"
    assert (ours[4].scale, direct[4].scale) == (2, 1)
    assert all(of.finish_cpu > 0 and of.render_cpu >= 0 for of in points.values())
    blender.unlink()
    assert run.compare(store, None, 256, [scene]).rows == comparison.rows
    _, table, *images = run.write_pages(store.folder, comparison)
    assert table.read_text().count("| disc |") == 2 * 7 + 10
    assert len(images) == 2 and all("<svg" in image.read_text() for image in images)
    assert read_record(store.folder / "displays.json", run.Comparison, "a comparison").rows == comparison.rows


def test_the_reference_is_perfect_less_views_are_not_and_the_nearest_woven_without_mixing(tmp_path):
    target = measure.Target.of(write_reference(tmp_path, noise=0.02, display=PANEL))
    field = light_field(PANEL)[..., :3]
    coarse = field.reshape(96, 16, 8, 3)[:, :, [1, 1, 1, 1, 6, 6, 6, 6]].reshape(field.shape)
    panels = [measure.shown(light, PANEL, "all") for light in (field, coarse)]
    perfect, worse = (target.accuracy(panel, measure.seen(panel, PANEL)) for panel in panels)
    assert perfect.ssim_eye > 0.99 and (perfect.psnr_panel or 99) > 45
    assert worse.ssim_eye < perfect.ssim_eye and worse.psnr_eye < (perfect.psnr_eye or 99)
    light = np.zeros((96, 128, 3), np.float32)
    light[:, 4:8] = 1.0
    assert set(np.unique(measure.shown(light, PANEL, "nearest"))) <= {0, 255}
    normal = np.zeros((64, 64, 3), np.float32) + np.float32([0, 0, 1])
    normal[:, 32:] = [-1, 0, 0]
    noisy = normal + np.random.default_rng(0).normal(0, 0.2, normal.shape).astype(np.float32)
    cleaned = measure.clean_guides({"normal": noisy})["normal"]
    assert np.abs(cleaned - normal).mean() < 0.5 * np.abs(noisy - normal).mean()


def test_time_for_an_accuracy_lies_between_those_of_two_points_and_the_published_comparison_is_read():
    points = [measure.Point(measure.OURS.name, 4, cpu / 2, cpu / 2, measure.Accuracy(30.0, None, ssim))
              for cpu, ssim in ((1.0, 0.8), (4.0, 0.9))]
    assert run.seconds_for(points, 0.85) == pytest.approx(2.0) and run.seconds_for(points, 0.7) == 1.0
    assert run.seconds_for(points, 0.95) is None
    published = Path(__file__).parents[4] / "docs" / "results" / "measured" / "displays.json"
    assert read_record(published, run.Comparison, "a comparison").rows[-1].points


@pytest.mark.parametrize("name", measure.FULL_WIDTH)
def test_a_smaller_panel_has_the_same_sheet_before_the_same_pixels_and_few_views_keep_its_lenses(name):
    whole, part = measure.kind(name), measure.kind(name, 384)
    assert part.panel_pixels == (384, 216)
    for axis in (0, 1):
        here, there = (profile.panel_mm[axis] / profile.panel_pixels[axis] for profile in (part, whole))
        assert math.isclose(here, there)
    assert (part.lenslet, part.subpixels, part.views) == (whole.lenslet, whole.subpixels, whole.views)
    if name == "lenticular":
        assert (part.lenticular.pitch_mm, part.lenticular.slant) == (whole.lenticular.pitch_mm, whole.lenticular.slant)
    else:
        assert math.isclose(part.panel_mm[0] / part.lenses[0], whole.panel_mm[0] / whole.lenses[0], rel_tol=0.03)
    assert part.viewing_angle_deg == whole.viewing_angle_deg
    assert math.isclose(part.viewing_distance_mm / part.panel_mm[0], whole.viewing_distance_mm / whole.panel_mm[0])
    few = measure.with_few_views(part)
    assert few.lenses == part.lenses and few.views == (measure.FEW, 1 if name == "lenticular" else measure.FEW)


@pytest.mark.parametrize("width", [0, 200, 7680 + 192])
def test_a_width_without_whole_lenses_is_refused(width):
    refuses(f"width is {width}, but", measure.kind, "lenticular", width)
