"""The scale that a scene's depth allows, seen by rays from the array's middle."""

import pytest

from blender_addon.jobs import asked, session
from blender_addon.render import frame_folder
from blender_addon.scene import settings as scene_settings
from blender_addon.scene.array import placement
from blender_addon.ui.operators import render
from lfsr_core.frames.frame import read_frame
from lfsr_core.optics.display import load_display
from tests.support import panel
from tests.support.requests import make_request
from tests.support.scenes import add_box, add_camera, add_lamp

SMALL = load_display("small")


def frame_of(scene, **options):
    job = make_request("nowhere", SMALL, world_visible=False, **{"scales": (4, 2, 1)} | options)
    with frame_folder.prepared(scene, job) as frame:
        return frame


def boxes(scene, depths):
    """Lit boxes side by side at these distances from the camera, all as large to see."""
    add_lamp(scene)  # or an image of light is prepared for each frame, which takes long
    add_camera(scene, (0, 0, 0), angle=0.6)
    for number, depth in enumerate(depths):
        add_box(scene, ((number - (len(depths) - 1) / 2) * 0.2 * depth, depth, 0), (0.09 * depth, 0.01, 0.15 * depth))


@pytest.mark.parametrize(("depths", "scale"), [((5.0, 5.1), 4), ((1.0, 20.0), 2)])
def test_deep_scenes_get_a_smaller_scale(scene, depths, scale):
    boxes(scene, depths)
    frame = frame_of(scene)
    assert frame.scale == scale and frame.scale_reason.values["scale"] == scale
    frame.display.low_views(frame.scale)


def test_a_scale_that_was_asked_for_stays(scene):
    boxes(scene, (1.0, 20.0))
    assert [(frame.scale, frame.scale_reason) for frame in (frame_of(scene, scales=()),
            frame_of(scene, kind="reference"))] == [(4, None), (1, None)]


def test_samples_follow_from_the_rays_and_fixed_ones_stay(scene):
    boxes(scene, (1.0, 20.0))
    deep = [(frame.scale, frame.samples) for frame in (frame_of(scene, rays=4.0), frame_of(scene, samples=64))]
    assert deep == [(1, 4), (1, 64)]
    assert frame_of(scene, samples=64).scale_reason.values["rays"] == 4


def test_a_few_frames_of_an_animation_decide_together(scene):
    boxes(scene, (5.0, 5.0))
    moved = scene.objects[-1]
    for number, factor in ((1, 1.0), (9, 20.0)):  # from the camera: as large to see
        moved.scale = (factor,) * 3
        moved.keyframe_insert("scale", frame=number)
    scene.frame_set(1)
    alone, together = frame_of(scene, rays=4.0), frame_of(scene, rays=4.0, frames=(1, 9))
    assert together.scale < alone.scale
    assert (scene.frame_current, together.frame) == (1, 1)
    assert frame_of(scene, rays=4.0, frame=9, frames=(1, 9)).scale == together.scale


def test_a_frame_without_an_array_does_not_count(scene):
    boxes(scene, (5.0, 5.1))
    for number, turned in ((1, 0.0), (9, 3.0)):
        scene.camera.rotation_euler.x = 1.5708 + turned
        scene.camera.keyframe_insert("rotation_euler", frame=number)
    scene.frame_set(1)
    assert frame_of(scene, frames=(1, 9)).scale == frame_of(scene).scale


def test_the_panel_leaves_the_choice_to_blender_and_gives_an_animation_one_scale(tmp_path, monkeypatch):
    with panel.registered():
        scene = panel.artist_scene(tmp_path)
        job = asked.asked(scene)[0]
        assert (job.sampling.scale, job.sampling.scales, job.sampling.rays) == (2, (), None)
        scene.lfsr.scale, scene.lfsr.samples, scene.lfsr.rays = scene_settings.AUTO_SCALE, 0, 0.5
        auto = asked.asked(scene)[0]
        assert (auto.sampling.scale, auto.sampling.scales, auto.sampling.samples, auto.sampling.rays) == (2, (2, 1), 2,
                0.5)
        scene.frame_end = 2
        monkeypatch.setattr(placement, "seen_depths", lambda *_: pytest.fail("Blender's window waits for it"))
        made = session.run("Animation", render.animation_job(scene)).result["made"]
        first, last = (read_frame(frame["folder"]) for frame in made)
        assert first.scale == last.scale and first.scale_reason.values["scale"] == first.scale
        assert first.samples == max(1, round(0.5 * first.scale**2))
