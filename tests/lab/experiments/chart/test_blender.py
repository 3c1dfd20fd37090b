"""``lfsr study chart`` once with Blender: a reference, a render, and the render again for its time."""

from __future__ import annotations

import pytest

from lfsr_core.cli import main
from tests.support.chart_folder import measured
from tests.support.prerequisites import needs_bpy


@needs_bpy
@pytest.mark.slow
def test_from_a_scene_to_a_chart(tmp_path):
    scene = tmp_path / "fan.obj"
    scene.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\n")
    words = ["study", "chart", str(scene), "-o", str(tmp_path / "out"), "--display", "mini", "--scale", "4"]
    words += ["--spps", "1", "--direct-spps", "none", "--seeds", "2", "--reference-spp", "2", "--lenses", "12"]
    words += ["--repeats", "1", "--render-repeats", "1", "--times", "--methods", "bicubic", "--ours", "bicubic"]
    assert main(words) == 0
    scene, = measured(tmp_path / "out")["scenes"]
    assert scene["reference"]["samples"] == 2 and scene["reference"]["lenses"] == 12
    cell, = scene["cells"]
    assert cell["seconds"]["mean"] > 0 and cell["errors"]["variance"]["mean"] > 0
