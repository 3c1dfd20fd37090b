"""Quality presets set samples and method, and follow them."""

from __future__ import annotations

import pytest

from blender_addon.settings import scene_settings
from tests.support import panel


@pytest.fixture
def scene(tmp_path):
    with panel.registered():
        yield panel.artist_scene(tmp_path)


@pytest.mark.parametrize("name", scene_settings.QUALITY)
def test_quality_sets_samples_and_method(scene, name):
    scene.lfsr.quality = name
    assert (scene.lfsr.samples, scene.lfsr.method) == scene_settings.QUALITY[name]
    assert scene.lfsr.quality == name


def test_changing_a_value_is_custom_and_back(scene):
    scene.lfsr.quality = "FINAL"
    samples = scene.lfsr.samples
    scene.lfsr.samples = samples + 1
    assert scene.lfsr.quality == "CUSTOM"
    scene.lfsr.samples = samples
    assert scene.lfsr.quality == "FINAL"


def test_more_quality_is_more_rays():
    samples = [scene_settings.QUALITY[name][0] for name in ("DRAFT", "BALANCED", "FINAL")]
    assert samples == sorted(samples) and len(set(samples)) == 3
