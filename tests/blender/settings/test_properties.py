"""Quality presets set samples and method, and follow them."""

from __future__ import annotations

import pytest

from blender_addon.settings import scene_settings
from lfsr_core.errors import LfsrError
from lfsr_core.reconstruct.method_name import DEFAULT_METHOD, HORIZONTAL_METHOD
from tests.support import panel


@pytest.fixture
def scene(tmp_path):
    with panel.registered():
        yield panel.artist_scene(tmp_path)


@pytest.mark.parametrize("name", scene_settings.QUALITY_SAMPLES)
def test_quality_sets_samples_and_method(scene, name):
    scene.lfsr.quality = name
    assert (scene.lfsr.samples, scene.lfsr.method) == (scene_settings.QUALITY_SAMPLES[name], DEFAULT_METHOD)
    assert scene.lfsr.quality == name


def test_changing_a_value_is_custom_and_back(scene):
    scene.lfsr.quality = "FINAL"
    samples = scene.lfsr.samples
    scene.lfsr.samples = samples + 1
    assert scene.lfsr.quality == "CUSTOM"
    scene.lfsr.samples = samples
    assert scene.lfsr.quality == "FINAL"


def test_a_preset_takes_the_method_for_the_displays_views(scene):
    scene.lfsr.quality = "BALANCED"
    scene.lfsr.display = "looking-glass-go"
    assert (scene.lfsr.quality, scene.lfsr.method) == ("BALANCED", HORIZONTAL_METHOD)
    scene.lfsr.scale = "3"
    scene_settings.resolve(scene).check()
    scene.lfsr.method = DEFAULT_METHOD
    assert scene.lfsr.quality == "CUSTOM"
    with pytest.raises(LfsrError, match="'looking-glass-go' has views in one direction"):
        scene_settings.resolve(scene).check()
    scene.lfsr.display, scene.lfsr.quality = "mini", "BALANCED"
    assert scene.lfsr.method == DEFAULT_METHOD


def test_saved_scenes_keep_their_displays():
    numbers = {item[0]: item[4] for item in scene_settings.profile_items()}
    assert [numbers[name] for name in ("FILE", "bupt-32in-8k", "dense-8k", "fhd", "mini", "small")] == list(range(6))
    assert len(set(numbers.values())) == len(numbers)


def test_more_quality_is_more_rays():
    samples = [scene_settings.QUALITY_SAMPLES[name] for name in ("DRAFT", "BALANCED", "FINAL")]
    assert samples == sorted(samples) and len(set(samples)) == 3
