"""Recipes of frames: their jobs, and what is refused before anything is rendered."""

from __future__ import annotations

import dataclasses

import bpy
import pytest

from blender_addon.jobs import recipes
from blender_addon.jobs.steps import SAVING
from lfsr_core.base.errors import LfsrError
from lfsr_core.frames.finish import Finish
from lfsr_core.frames.frame import EIA_FILE, write_frame
from lfsr_core.frames.report import Report, write_report
from tests.support import panel
from tests.support.synthetic import frame_of


@pytest.fixture
def scene(tmp_path):
    with panel.registered():
        yield panel.artist_scene(tmp_path)


def test_a_missing_interpreter_is_an_error_before_the_render(scene, monkeypatch):
    monkeypatch.setenv("LFSR_PYTHON", "/no/such/python")
    monkeypatch.setattr(recipes, "render_step", lambda *_: pytest.fail("it renders"))
    with pytest.raises(RuntimeError, match="/no/such/python"):
        bpy.ops.lfsr.render_eia()


def test_errors_are_lfsr_errors(scene):
    scene.lfsr.scale = "3"
    with pytest.raises(LfsrError, match="choose a scale"):
        recipes.frame_recipe(scene)


def test_an_animation_is_averaged_as_the_panel_says(scene, monkeypatch):
    asked = []
    monkeypatch.setattr(recipes, "rendering_step", lambda *_, **arguments: asked.append(arguments) or SAVING)
    for count in (0, 2):
        scene.lfsr.temporal_averaging = count
        steps = recipes.render_animation(recipes.animation_recipe(scene))
        assert next(steps) == SAVING
        next(steps)
        steps.close()
    assert [arguments["second"]["temporal_averaging"] for arguments in asked] == [0, 2]
    assert {arguments["job"]["seed"] for arguments in asked} == {scene.lfsr.seed}, "each frame's follows from it"


def test_a_frame_of_an_averaged_animation_is_the_panels_in_spite_of_its_seed(scene):
    scene.frame_set(3)
    recipe = recipes.frame_recipe(scene)
    recipe.folder.mkdir(parents=True)
    (recipe.folder / EIA_FILE).touch()
    job = recipe.job
    for seed, averaging, complete in ((0, 0, True), (2, 0, False), (2, 2, True), (2, 1, True), (1, 2, False)):
        write_frame(recipe.folder, frame_of(job.sampling.scale, samples=job.sampling.samples, seed=seed, frame=3))
        write_report(recipe.folder, Report(Finish(recipe.method, temporal_averaging=averaging), recipe.method,
                                               "mini", job.sampling.scale, job.sampling.samples, {}, None, 1.0))
        assert recipe.is_complete == complete
    assert not dataclasses.replace(recipe, method="bilinear").is_complete
