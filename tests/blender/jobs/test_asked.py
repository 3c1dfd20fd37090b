"""What buttons ask for, and what is refused before anything is rendered."""

import dataclasses
import time
from pathlib import Path

import bpy
import pytest

from blender_addon.jobs import folders, runtime
from blender_addon.ui.operators import render
from blender_addon.ui.operators.render import check_questions
from lfsr_core.base.records import to_data
from lfsr_core.frames.frame import CALM, EIA_FILE, Report, write_frame, write_report
from lfsr_core.optics.display import DisplayProfile, load_display, write_profile
from lfsr_core.tasks import runner as estimate
from tests.support.panels import lenticular, small
from tests.support.requests import changed
from tests.support.synthetic import frame_of


def test_an_animation_is_averaged_as_the_panel_says_and_chooses_one_scale_by_some_of_its_frames(scene):
    for count, method, calm in ((0, "pool", CALM / 2), (2, "denoise+pool", CALM)):
        scene.lfsr.temporal_averaging, scene.lfsr.method = count, method
        arguments, image = (job.arguments for job in (render.animation_job(scene), render.image_job(scene, True, 7)))
        assert arguments["finish"].temporal_averaging == count
        assert arguments["request"].seed == scene.lfsr.seed, "each frame's follows from it"
        assert image["finish"].temporal_averaging == 0 and image["request"].calm == calm
    assert folders.frame_folder(scene) != render.image_job(scene, number=7).output == folders.frame_folder(scene, 7)
    scene.frame_end = 9
    assert render.animation_job(scene).arguments["request"].sampling.frames == ()
    scene.lfsr.scale, scene.lfsr.samples, scene.lfsr.rays = "AUTO", 0, 0.5
    frames = render.animation_job(scene).arguments["request"].sampling.frames
    assert len(frames) > 1 and {frames[0], frames[-1]} == {1, 9}


def test_a_frame_of_an_averaged_animation_is_the_panels_in_spite_of_its_seed(scene):
    scene.frame_set(3)
    request, finish = folders.requested(scene)
    folder = Path(request.output)
    folder.mkdir(parents=True)
    (folder / EIA_FILE).touch()
    for seed, averaging, made in ((0, 0, True), (2, 0, False), (2, 2, True), (2, 1, True), (1, 2, False)):
        write_frame(folder, frame_of(request.sampling.scale, samples=request.sampling.samples, seed=seed, frame=3))
        used = dataclasses.replace(finish, temporal_averaging=averaging)
        write_report(folder, Report(used, finish.method, "mini", request.sampling.scale, request.sampling.samples, {},
                                    None, 1.0))
        assert folders.is_made(request, finish) == made
    assert not folders.is_made(request, dataclasses.replace(finish, method="bilinear"))


def remembered(scene, **values) -> None:
    folders.remember(scene.name_full, estimate.Measured(**({"fixed": 2.0, "per_path": 1e-5, "scale": 2} | values)))


def test_lenses_are_spread_over_the_display(scene):
    request, _ = folders.requested(scene)
    assert len(set(estimate.lenses_of(request))) == 16 * 12, "few enough to render all"
    assert estimate.samples_of(request) * 64 * 48 == pytest.approx(estimate.PATHS, rel=0.01), "and enough to measure"
    scene.lfsr.display, scene.lfsr.scale, scene.lfsr.samples = "bupt-32in-8k", "4", 64
    request, _ = folders.requested(scene)
    lenses, (columns, rows) = estimate.lenses_of(request), request.display.lenses
    assert 80 < len(set(lenses)) == len(lenses) < 100
    assert 0 <= min(row for row, _ in lenses) < rows / 3 and rows * 2 / 3 < max(row for row, _ in lenses) < rows
    assert 0 <= min(at for _, at in lenses) < columns / 3 and columns * 2 / 3 < max(at for _, at in lenses) < columns


def test_a_button_measures_as_long_as_an_image_takes_also_of_subpixels(scene, tmp_path, monkeypatch):
    scene.lfsr.display, scene.lfsr.scale, scene.lfsr.samples = "small", "4", 16
    assert folders.expected_seconds(scene) is None and bpy.ops.lfsr.estimate_time() == {"FINISHED"}
    expected, started = folders.expected_seconds(scene), time.monotonic()
    assert bpy.ops.lfsr.render_eia() == {"FINISHED"}
    assert 0.2 < expected / (time.monotonic() - started) < 5  # tests run on busy machines
    monkeypatch.setattr(estimate, "PATHS", 10**5)
    for size, lenses, scale in (((64, 8), (8, 1), 4), ((8, 8), (1, 1), 2)):  # few are enough pixels for Blender
        request = changed(folders.requested(scene)[0], scene=bpy.data.filepath, scale=scale,
                          display=DisplayProfile("few", size, size, lenses, (8, 8), 180.0, 40.0))
        assert 0 < estimate.estimate(to_data(request), runtime.render_command())["per_path"] < 1e-4
    write_profile(tmp_path / "own.toml", small(lenticular()))
    scene.lfsr.profile_file = str(tmp_path / "own.toml")
    scene.lfsr.display, scene.lfsr.subpixels, scene.lfsr.samples = "FILE", True, 8
    assert bpy.ops.lfsr.estimate_time() == {"FINISHED"}
    expected = folders.expected_seconds(scene)
    scene.lfsr.samples = 16
    assert folders.expected_seconds(scene) - expected == pytest.approx(
        8 * 120 * 3 * 80 * bpy.context.window_manager.lfsr.probe_per_path, rel=1e-3)


def test_a_long_image_is_asked_about_until_accepted_and_other_settings_need_no_other_probe(scene):
    remembered(scene)
    assert check_questions(scene) == []
    remembered(scene, per_path=1.0)
    (question,) = check_questions(scene)
    assert question.sentence.startswith("The image will take about ") and not question.advice
    question.accept()
    assert check_questions(scene) == []
    remembered(scene, per_path=30.0)
    assert len(check_questions(scene)) == 1
    remembered(scene, per_path=1e-2)
    assert check_questions(scene) == []
    assert [question.sentence[:9] for question in check_questions(scene, 250)] == ["250 image"], "each takes little"
    display = load_display("mini")
    remembered(scene)
    scene.lfsr.samples = 100
    pixels, few = display.eia_pixels[0] * display.eia_pixels[1] / 4, folders.expected_seconds(scene)
    scene.lfsr.samples = 1100
    assert folders.expected_seconds(scene) - few == pytest.approx(1000 * pixels * 1e-5, rel=1e-3)
    state, slow = bpy.context.window_manager.lfsr, frame_of(4, samples=10**4, seconds={"render": 900.0})
    folders.learn(scene.name_full, slow, folders.requested(scene)[0].sampled(samples=10**4))
    assert state.probe_per_path > 1e-4 and (state.probe_scale, state.probe_fixed) == (4, 2.0), "of the last image"
    bpy.ops.scene.new(type="EMPTY")
    assert folders.expected_seconds(bpy.context.scene) is None, "another scene"


@pytest.mark.parametrize(("method", "least"), [("denoise+pool", 1), ("pool", 2), ("none", 1)])
def test_views_are_left_out_where_nothing_but_pooling_removes_noise(scene, method, least):
    scene.lfsr.method, scene.lfsr.scale = method, "AUTO"
    assert min(folders.requested(scene)[0].sampling.scales) == least
