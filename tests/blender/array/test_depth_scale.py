"""The scale that a scene's depth allows, seen by rays from the array's middle."""

from __future__ import annotations

import dataclasses

import pytest

from blender_addon.render import frame_folder
from blender_addon.settings import scene_settings
from lfsr_core.frames.job import Job
from lfsr_core.optics.display import load_display
from tests.support import panel
from tests.support.scenes import add_box, add_camera

SMALL = load_display("small")


def frame_of(scene, **options):
    job = Job("nowhere", SMALL, world_visible=False, **{"scales": (4, 2, 1)} | options)
    with frame_folder.prepared(scene, job) as frame:
        return frame


def boxes(scene, depths):
    """Boxes side by side at these distances from the camera, all as large to see."""
    add_camera(scene, (0, 0, 0), angle=0.6)
    for number, depth in enumerate(depths):
        add_box(scene, ((number - (len(depths) - 1) / 2) * 0.2 * depth, depth, 0), (0.09 * depth, 0.01, 0.15 * depth))


@pytest.mark.parametrize(("depths", "scale"), [((5.0, 5.1), 4), ((1.0, 20.0), 1)])
def test_deep_scenes_get_a_smaller_scale(scene, depths, scale):
    boxes(scene, depths)
    frame = frame_of(scene)
    assert frame.scale == scale and frame.scale_reason.startswith(f"scale {scale}")
    frame.display.low_views(frame.scale)


def test_a_scale_that_was_asked_for_stays(scene):
    boxes(scene, (1.0, 20.0))
    assert [(frame.scale, frame.scale_reason) for frame in (frame_of(scene, scales=()),
            frame_of(scene, kind="reference"))] == [(4, ""), (1, "")]


def test_the_panel_chooses_before_it_renders(tmp_path):
    with panel.registered():
        scene = panel.artist_scene(tmp_path)
        job = scene_settings.resolve_for_render(scene).job(tmp_path, 1)
        assert (job.scale, job.scale_reason) == (2, "")
        scene.lfsr.scale = scene_settings.AUTO_SCALE
        auto = scene_settings.resolve_for_render(scene).job(tmp_path, 1)
        assert auto.scale in (2, 4) and auto.scale_reason.startswith(f"scale {auto.scale}")
        assert not auto.scales and dataclasses.replace(auto, scale=2, scale_reason="") == job
