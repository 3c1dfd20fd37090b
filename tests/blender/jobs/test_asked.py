"""What buttons ask for, and what is refused before anything is rendered."""

import dataclasses
from pathlib import Path

import bpy
import pytest

from blender_addon.jobs import asked, session
from blender_addon.ui.operators import render
from lfsr_core.frames.frame import EIA_FILE, write_frame
from lfsr_core.frames.request import Report, write_report
from tests.support import panel
from tests.support.synthetic import frame_of
from tests.support.told import refuses


def test_a_missing_interpreter_is_an_error_before_the_render(scene, monkeypatch):
    monkeypatch.setenv("LFSR_PYTHON", "/no/such/python")
    monkeypatch.setattr(session, "run", lambda *_: pytest.fail("it renders"))
    panel.refused("/no/such/python", bpy.ops.lfsr.render_eia)


def test_errors_are_lfsr_errors(scene):
    scene.lfsr.scale = "3"
    refuses("choose a scale", asked.asked, scene)


def test_an_animation_is_averaged_as_the_panel_says_and_an_image_is_not(scene):
    for count in (0, 2):
        scene.lfsr.temporal_averaging = count
        arguments = render.animation_job(scene).arguments
        assert arguments["finish"].temporal_averaging == count
        assert arguments["request"].seed == scene.lfsr.seed, "each frame's follows from it"
        assert render.image_job(scene).arguments["finish"].temporal_averaging == 0


def test_an_animation_chooses_one_scale_by_some_of_its_frames(scene):
    scene.frame_end = 9
    assert render.animation_job(scene).arguments["request"].sampling.frames == ()
    scene.lfsr.scale, scene.lfsr.samples, scene.lfsr.rays = "AUTO", 0, 0.5
    frames = render.animation_job(scene).arguments["request"].sampling.frames
    assert len(frames) > 1 and {frames[0], frames[-1]} == {1, 9}


def test_a_frame_of_an_averaged_animation_is_the_panels_in_spite_of_its_seed(scene):
    scene.frame_set(3)
    request, finish = asked.asked(scene)
    folder = Path(request.output)
    folder.mkdir(parents=True)
    (folder / EIA_FILE).touch()
    for seed, averaging, made in ((0, 0, True), (2, 0, False), (2, 2, True), (2, 1, True), (1, 2, False)):
        write_frame(folder, frame_of(request.sampling.scale, samples=request.sampling.samples, seed=seed, frame=3))
        used = dataclasses.replace(finish, temporal_averaging=averaging)
        write_report(folder, Report(used, finish.method, "mini", request.sampling.scale, request.sampling.samples, {},
                                    None, 1.0))
        assert asked.is_made(request, finish) == made
    assert not asked.is_made(request, dataclasses.replace(finish, method="bilinear"))
