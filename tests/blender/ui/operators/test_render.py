"""The render buttons without a window: results, skipped frames, the comparison, cancel and crash."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import bpy
import numpy as np
import pytest

from blender_addon.background import recipes, session
from blender_addon.results import preview
from blender_addon.settings import scene_settings
from blender_addon.ui import summary
from lfsr_core.errors import LfsrError
from lfsr_core.files import read_json
from lfsr_core.frames.frame import read_frame
from lfsr_core.images.png import read_png
from tests.support import panel

SECONDS_TO_RENDER = 300


@pytest.fixture(scope="module")
def add_on():
    with panel.registered():
        yield


@pytest.fixture
def scene(add_on, tmp_path):
    """A fresh scene, for tests that render nothing or spoil it."""
    return panel.artist_scene(tmp_path)


@pytest.fixture(scope="module")
def rendered(add_on, tmp_path_factory) -> Path:
    """A file whose frame 1 was rendered by the button."""
    folder = tmp_path_factory.mktemp("rendered")
    scene = panel.artist_scene(folder)
    before = panel.snapshot(scene)
    assert bpy.ops.lfsr.render_eia() == {"FINISHED"}
    assert panel.snapshot(bpy.context.scene) == before
    return folder / "scene.blend"


@pytest.fixture
def opened(rendered) -> bpy.types.Scene:
    bpy.ops.wm.open_mainfile(filepath=str(rendered))
    return bpy.context.scene


def frame_one(rendered: Path) -> Path:
    return rendered.parent / "lightfield" / "Scene" / "0001"


def test_render_writes_the_frame_folder_beside_the_file(rendered):
    folder = frame_one(rendered)
    names = {path.name for path in folder.iterdir()}
    assert names == {"frame.json", "lr_eia.exr", "mask.png", "eia.png", "report.json"}
    assert [path.name for path in folder.parent.iterdir()] == ["0001"]
    image = read_png(folder / "eia.png")
    assert image.shape == (96, 128, 3) and image.max() > 60
    frame, report = read_frame(folder), read_json(folder / "report.json", "report")
    assert (frame.display.name, frame.scale, frame.samples, frame.frame) == ("mini", 2, 1, 1)
    assert report["method"] == "bicubic" and 0 < report["foreground_share"] < 1


def test_render_used_the_array_of_the_scene(opened, rendered):
    from blender_addon.array import rig

    array, matrix = rig.placement(opened, scene_settings.display_of(opened))
    frame = read_frame(frame_one(rendered))
    assert frame.array.distance == pytest.approx(array.distance, rel=1e-6)
    assert np.allclose(frame.matrix_world, matrix, atol=1e-6)


def test_preview_shows_the_view_of_the_eye(opened, rendered):
    assert bpy.ops.lfsr.preview_view() == {"FINISHED"}
    image = bpy.data.images[preview.IMAGE_NAME]
    views = np.load(recipes.views_file(frame_one(rendered)))
    assert views.shape == (8, 8, 12, 16, 3)
    for eye, index in {(-1, 1): (0, 0), (1, 1): (0, 7), (1, -1): (7, 7)}.items():
        opened.lfsr.eye_right, opened.lfsr.eye_up = eye
        pixels = np.array(image.pixels).reshape(image.size[1], image.size[0], 4)
        times = image.size[0] // 16
        shown = pixels[::-1, :, :3][times // 2::times, times // 2::times]
        assert np.allclose(shown, views[index] / 255, atol=0.01), eye


def test_decoded_views_are_not_mirrored(opened, rendered):
    # Behind lenses the panel holds each elemental image turned round: the left eye's view comes from its right end.
    panel_order = read_png(frame_one(rendered) / "eia.png").reshape(12, 8, 16, 8, 3)
    views = np.load(recipes.views_file(frame_one(rendered)))
    assert np.array_equal(views[0, 0], panel_order[:, 7, :, 7])


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
    path.unlink()
    print(f"preview of an 8K image: {np.median(seconds) * 1000:.1f} ms")
    assert np.median(seconds) < 0.1


def test_another_file_does_not_show_the_old_ones_views(opened, rendered):
    bpy.ops.lfsr.preview_view()
    assert preview.is_loaded(opened)
    bpy.ops.wm.open_mainfile(filepath=str(rendered))
    assert not preview.is_loaded(bpy.context.scene)


def test_animation_skips_complete_frames(opened, rendered):
    folder = frame_one(rendered)
    untouched = (folder / "eia.png").stat().st_mtime_ns
    opened.frame_start, opened.frame_end = 1, 2
    assert len(recipes.animation_recipes(opened)[0]) == 1
    assert bpy.ops.lfsr.render_animation() == {"FINISHED"}
    assert (folder / "eia.png").stat().st_mtime_ns == untouched
    assert read_frame(folder.with_name("0002")).frame == 2
    assert recipes.animation_recipes(opened) == ([], 2)
    assert bpy.ops.lfsr.render_animation() == {"FINISHED"}
    opened.lfsr.samples = 3
    assert len(recipes.animation_recipes(opened)[0]) == 2
    opened.lfsr.samples, opened.lfsr.use_overwrite = 1, True
    assert len(recipes.animation_recipes(opened)[0]) == 2


def test_reference_and_ssim(opened, rendered):
    opened.lfsr.reference_samples, opened.lfsr.reference_lenses = 2, 16
    before = panel.snapshot(opened)
    assert bpy.ops.lfsr.render_reference() == {"FINISHED"}
    assert panel.snapshot(opened) == before
    reference = frame_one(rendered).with_name("0001_reference")
    assert {path.name for path in reference.iterdir()} == {"frame.json", "reference_a.exr", "reference_b.exr"}
    assert len(read_frame(reference).lens_list) == 16
    metrics = read_json(frame_one(rendered) / "report.json", "report")["metrics"]
    assert "ssim_eia_fg" in metrics
    assert "SSIM, foreground" in dict(summary.metric_facts(opened))


def test_reference_needs_the_image_of_these_settings(opened):
    opened.lfsr.samples = 5
    with pytest.raises(RuntimeError, match="made with other settings"):
        bpy.ops.lfsr.render_reference()
    opened.frame_set(44)
    with pytest.raises(RuntimeError, match="render the EIA first"):
        bpy.ops.lfsr.render_reference()
    with pytest.raises(RuntimeError, match="to preview: render the EIA first"):
        bpy.ops.lfsr.preview_view()


@pytest.mark.parametrize("stage", ["Rendering", "Upscaling"])
def test_cancel_is_quick_and_leaves_nothing(scene, tmp_path, stage):
    before = panel.snapshot(scene)
    steps = recipes.render_frames([recipes.frame_recipe(scene)])
    task = session.start("Render EIA", steps, lambda _: pytest.fail("it finished"))
    wait_for(lambda: task.stage.startswith(stage))
    started = time.perf_counter()
    assert bpy.ops.lfsr.cancel() == {"FINISHED"}
    seconds = time.perf_counter() - started
    print(f"cancel while {stage}: {seconds:.2f} s")
    assert seconds < 2 and session.current() is None
    assert panel.snapshot(scene) == before
    assert list((tmp_path / "lightfield" / "Scene").iterdir()) == []
    assert not list(Path(bpy.app.tempdir).glob("lfsr-*/*.blend"))


def test_a_worker_that_dies_is_reported(scene, tmp_path):
    before = panel.snapshot(scene)
    task = session.start("Render EIA", recipes.render_frames([recipes.frame_recipe(scene)]), print)
    os.killpg(task.worker.pid, signal.SIGKILL)
    wait_for(lambda: session.current() is None)
    message = bpy.context.window_manager.lfsr.message
    assert "The render stopped with signal 9" in message and "try again" in message
    assert panel.snapshot(scene) == before
    assert list((tmp_path / "lightfield" / "Scene").iterdir()) == []


def test_a_worker_that_ignores_the_end_is_killed():
    from blender_addon.background.worker import Worker

    deaf = Worker("Test", ["/bin/sh", "-c", "trap '' TERM; echo 'LFSR {\"stage\": \"x\"}'; while :; do sleep 9; done"],
                  dict(os.environ))
    wait_for(lambda: deaf.records() or not deaf.running(), look=False)
    started = time.perf_counter()
    deaf.stop()
    assert time.perf_counter() - started < 2 and not deaf.running()


def test_progress_and_time_left(scene):
    task = session.start("Render EIA", recipes.render_frames([recipes.frame_recipe(scene)]), print)
    task._take({"stage": "render", "fraction": 0.5})
    task._started -= 10
    assert task.fraction == pytest.approx(0.5 * recipes.RENDER_SHARE)
    assert task.seconds_left == pytest.approx(10 * (1 - task.fraction) / task.fraction, abs=1)
    assert session.progress_text(task).startswith("42%, 0:13 left")
    assert task.stage == "Rendering"
    session.cancel()


def test_a_missing_interpreter_is_an_error_before_the_render(scene, monkeypatch):
    monkeypatch.setenv("LFSR_PYTHON", "/no/such/python")
    monkeypatch.setattr(recipes, "render_step", lambda *_: pytest.fail("it renders"))
    with pytest.raises(RuntimeError, match="/no/such/python"):
        bpy.ops.lfsr.render_eia()


def test_no_task_to_cancel(add_on):
    assert bpy.ops.lfsr.cancel() == {"CANCELLED"}


def test_errors_are_lfsr_errors(scene):
    scene.lfsr.scale = "3"
    with pytest.raises(LfsrError, match="choose a scale"):
        recipes.frame_recipe(scene)


def wait_for(condition, look: bool = True) -> None:
    """Turn the timer by hand: without a window nothing else does."""
    ends = time.monotonic() + SECONDS_TO_RENDER
    while not condition():
        assert time.monotonic() < ends
        if look:
            session._look()
        time.sleep(0.02)
