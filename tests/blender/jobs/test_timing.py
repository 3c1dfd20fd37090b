"""How long an image will take, before it is rendered."""

import time

import bpy
import pytest

from blender_addon.jobs import asked
from blender_addon.ui.operators import check
from lfsr_core.optics.display import load_display, write_profile
from lfsr_core.tasks import runner as estimate
from tests.support.panels import lenticular, small


def remembered(scene, **values) -> None:
    asked.remember(scene.name_full, estimate.Measured(**({"fixed": 2.0, "per_path": 1e-5, "scale": 2} | values)))


def test_lenses_are_spread_over_the_display(scene):
    request, _ = asked.asked(scene)
    assert len(set(estimate.lenses_of(request))) == 16 * 12, "few enough to render all"
    assert estimate.samples_of(request) * 64 * 48 == pytest.approx(estimate.PATHS, rel=0.01), "and enough to measure"
    scene.lfsr.display, scene.lfsr.scale, scene.lfsr.samples = "bupt-32in-8k", "4", 64
    request, _ = asked.asked(scene)
    lenses, (columns, rows) = estimate.lenses_of(request), request.display.lenses
    assert 80 < len(set(lenses)) == len(lenses) < 100
    assert 0 <= min(row for row, _ in lenses) < rows / 3 and rows * 2 / 3 < max(row for row, _ in lenses) < rows
    assert 0 <= min(at for _, at in lenses) < columns / 3 and columns * 2 / 3 < max(at for _, at in lenses) < columns


def test_the_button_measures_and_the_image_takes_about_that_long(scene):
    scene.lfsr.display, scene.lfsr.scale, scene.lfsr.samples = "small", "4", 16
    assert asked.expected_seconds(scene) is None
    assert bpy.ops.lfsr.estimate_time() == {"FINISHED"}
    expected, started = asked.expected_seconds(scene), time.monotonic()
    assert bpy.ops.lfsr.render_eia() == {"FINISHED"}
    took = time.monotonic() - started
    print(f"expected {expected:.1f} s, took {took:.1f} s")
    assert 0.2 < expected / took < 5  # tests run on busy machines


def test_direct_subpixel_rendering_is_measured_too(scene, tmp_path):
    write_profile(tmp_path / "own.toml", small(lenticular()))
    scene.lfsr.profile_file = str(tmp_path / "own.toml")
    scene.lfsr.display, scene.lfsr.subpixels, scene.lfsr.samples = "FILE", True, 8
    assert bpy.ops.lfsr.estimate_time() == {"FINISHED"}
    expected = asked.expected_seconds(scene)
    scene.lfsr.samples = 16
    paths = 8 * 120 * 3 * 80
    assert asked.expected_seconds(scene) - expected == pytest.approx(
        paths * bpy.context.window_manager.lfsr.probe_per_path, rel=1e-3)


def test_other_settings_need_no_other_probe(scene):
    display = load_display("mini")
    remembered(scene)
    scene.lfsr.samples = 100
    pixels = display.eia_pixels[0] * display.eia_pixels[1] / 4
    few = asked.expected_seconds(scene)
    scene.lfsr.samples = 1100
    assert asked.expected_seconds(scene) - few == pytest.approx(1000 * pixels * 1e-5, rel=1e-3)
    bpy.ops.scene.new(type="EMPTY")
    assert asked.expected_seconds(bpy.context.scene) is None, "another scene"


def test_a_long_image_is_asked_about_until_it_is_accepted(scene):
    remembered(scene)
    assert check.questions(scene) == []
    remembered(scene, per_path=1.0)
    (question,) = check.questions(scene)
    assert question.sentence.startswith("The image will take about ") and not question.advice
    question.accept()
    assert check.questions(scene) == []
    remembered(scene, per_path=30.0)
    assert len(check.questions(scene)) == 1
    remembered(scene, per_path=1e-2)
    assert check.questions(scene) == []
    assert [question.sentence[:9] for question in check.questions(scene, 250)] == ["250 image"], "each takes little"
