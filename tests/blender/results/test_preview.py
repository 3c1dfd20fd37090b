"""The preview's speed at full size."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from blender_addon.background import recipes
from blender_addon.results import preview
from tests.support import panel


@pytest.fixture
def scene(tmp_path):
    with panel.registered():
        yield panel.artist_scene(tmp_path)


def test_preview_is_fast_for_an_8k_image(scene):
    views = np.random.default_rng(0).integers(0, 255, (80, 80, 54, 96, 3), np.uint8)
    path = recipes.views_file(Path("/8k"))
    np.save(path, views)
    preview.load(scene, path)
    seconds = []
    for eye in np.linspace(-1, 1, 9):
        started = time.perf_counter()
        scene.lfsr.eye_right = eye
        seconds.append(time.perf_counter() - started)
    maps = Path("/proc/self/maps")
    assert not maps.is_file() or str(path) not in maps.read_text(), "Windows replaces no mapped file"
    path.unlink()
    print(f"preview of an 8K image: {np.median(seconds) * 1000:.1f} ms")
    assert np.median(seconds) < 0.1
