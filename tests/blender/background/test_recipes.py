"""Recipes of frames: what is refused before anything is rendered."""

from __future__ import annotations

import bpy
import pytest

from blender_addon.background import recipes
from lfsr_core.errors import LfsrError
from tests.support import panel


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
