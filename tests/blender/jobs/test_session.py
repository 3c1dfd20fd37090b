"""The task under way: progress, cancel, a worker that dies."""

from __future__ import annotations

import os
import re
import signal
import time
from pathlib import Path

import bpy
import pytest

from blender_addon.jobs import copy, estimate, recipes, session, steps
from blender_addon.ui.operators import render
from tests.support import panel


@pytest.fixture
def scene(tmp_path):
    with panel.registered():
        yield panel.artist_scene(tmp_path)


def message_is_error() -> bool:
    return bpy.context.window_manager.lfsr.message_is_error


@pytest.mark.parametrize("stage", ["Rendering", "Upscaling"])
def test_cancel_is_quick_and_leaves_nothing(scene, tmp_path, stage):
    before = panel.snapshot(scene)
    steps = recipes.render_frame(recipes.frame_recipe(scene))
    task = session.start("Render EIA", steps, lambda _: pytest.fail("it finished"))
    panel.wait_for(lambda: task.stage.startswith(stage))
    started = time.perf_counter()
    assert bpy.ops.lfsr.cancel() == {"FINISHED"}
    assert (bpy.context.window_manager.lfsr.message, message_is_error()) == ("Cancelled", False)
    seconds = time.perf_counter() - started
    print(f"cancel while {stage}: {seconds:.2f} s")
    assert seconds < 2 and session.current() is None
    assert panel.snapshot(scene) == before
    assert list((tmp_path / "lightfield" / "scene" / "Scene").iterdir()) == []
    assert not list(Path(bpy.app.tempdir).glob("lfsr-*/*.blend"))


def test_a_worker_that_dies_is_reported(scene, tmp_path):
    before = panel.snapshot(scene)
    task = session.start("Render EIA", recipes.render_frame(recipes.frame_recipe(scene)), print)
    panel.wait_for(lambda: task.worker)
    os.killpg(task.worker.pid, signal.SIGKILL)
    panel.wait_for(lambda: session.current() is None)
    message = bpy.context.window_manager.lfsr.message
    assert "The render stopped with signal 9" in message and "try again" in message and message_is_error()
    assert panel.snapshot(scene) == before
    assert list((tmp_path / "lightfield" / "scene" / "Scene").iterdir()) == []


def test_a_render_that_worked_is_one_quiet_line(scene, tmp_path, monkeypatch):
    popups = []
    monkeypatch.setattr(session, "tell", lambda *said: popups.append(said))
    state = bpy.context.window_manager.lfsr
    state.message = "of the last render"
    task = session.start("Render EIA", recipes.render_frame(recipes.frame_recipe(scene)), render.show_image_of(scene))
    task.warnings += ["the sequencer's strips are not rendered"]
    panel.wait_for(lambda: session.current() is None)
    assert re.fullmatch(r"Done in \d:\d\d", state.outcome) and popups == []
    assert state.outcome_folder == str(tmp_path / "lightfield" / "scene" / "Scene" / "0001")
    assert (state.message, message_is_error()) == ("The sequencer's strips are not rendered", False)


def test_a_cancelled_animation_can_be_continued(scene):
    task = session.start("Render Animation", recipes.render_animation(recipes.animation_recipe(scene)), print)
    panel.wait_for(lambda: task.worker)
    assert bpy.ops.lfsr.cancel() == {"FINISHED"}
    assert bpy.context.window_manager.lfsr.message == task.cancelled == "Cancelled. Render again to continue"


def test_saving_is_announced_before_blender_stops_for_it(scene, monkeypatch):
    saved = []
    monkeypatch.setattr(copy, "save_copy", lambda path: saved.append(path) or path.touch() or path)
    task = session.start("Render EIA", recipes.render_frame(recipes.frame_recipe(scene)), print)
    assert (saved, task.worker, task.ended) == ([], None, False)
    assert session.progress_text(task) == "Saving a copy of the file"
    assert bpy.ops.lfsr.cancel() == {"FINISHED"} and task.ended and not saved
    task = session.start("Render EIA", recipes.render_frame(recipes.frame_recipe(scene)), print)
    session._look()
    assert len(saved) == 1 and task.worker and task.stage == "Rendering"
    session.cancel()


def test_a_copy_has_no_preview_image_and_the_preferences_stay(scene, tmp_path):
    preferences, seen = bpy.context.preferences, []
    before = preferences.filepaths.file_preview_type, preferences.is_dirty
    assert before[0] != "NONE"

    def note(*_: object) -> None:
        seen.append(preferences.filepaths.file_preview_type)
    bpy.app.handlers.save_pre.append(note)
    copy.save_copy(tmp_path / "copy.blend")
    bpy.app.handlers.save_pre.remove(note)
    assert seen == ["NONE"] and (tmp_path / "copy.blend").is_file()
    assert (preferences.filepaths.file_preview_type, preferences.is_dirty) == before


def test_a_copy_that_cannot_be_saved_ends_the_task(scene, monkeypatch):
    monkeypatch.setattr(copy, "parts_folder", lambda _: Path("/dev/null/parts"))
    monkeypatch.setattr(copy.tempfile, "mkdtemp", lambda **_: "/no/such/folder")
    task = session.start("Render EIA", recipes.render_frame(recipes.frame_recipe(scene)), print)
    panel.wait_for(lambda: session.current() is None)
    assert task.ended and "cannot be saved" in bpy.context.window_manager.lfsr.message and message_is_error()


def test_progress_and_time_left(scene, monkeypatch):
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)  # no speed of an earlier render is known
    monkeypatch.setattr(estimate, "_slower", {})  # nor how fast this machine finished one
    scene = bpy.context.scene
    task = session.start("Render EIA", recipes.render_frame(recipes.frame_recipe(scene)), print)
    panel.wait_for(lambda: task.worker)
    assert session.progress_text(task) == "Opening the scene"
    task._take({"stage": "open", "fraction": 0.0, "message": "/tmp/copy.blend, for 3 s"})
    assert task.message == session.progress_text(task) == "Opening the scene", "no temporary path"
    now = time.monotonic()
    monkeypatch.setattr(steps.time, "monotonic", lambda: now)
    task._take({"stage": "render", "fraction": 0.0, "message": "Sample 0/4"})
    assert task.seconds_left is None and session.progress_text(task) == "Rendering 0%"
    now += 10
    task._take({"stage": "render", "fraction": 0.5, "message": "Sample 2/4"})
    finish, rest = task._step.after, 10 * estimate.FIRST_PACE
    assert task.seconds_left == pytest.approx(rest + finish) and finish > 0.5
    percent = round(100 * recipes.RENDER_FRACTION * 10 / (10 + rest))
    assert session.progress_text(task) == f"Rendering {percent}%, 0:{rest + finish:02.0f} left"
    now += 4
    task._take({"stage": "render", "fraction": 0.5, "message": "Sample 2/4, for 4 s", "repeated": True})
    assert task.seconds_left == pytest.approx(rest - 4 + finish), "no news is not slower"
    assert task.fraction == pytest.approx(14 / (10 + rest) * recipes.RENDER_FRACTION)
    assert task.message == "Sample 2/4, for 4 s"
    session.cancel()


def test_progress_counts_from_when_it_was_written_not_from_when_it_was_looked_at(scene):
    task = session.start("Render EIA", recipes.render_frame(recipes.frame_recipe(scene)), print)
    heard = []
    panel.wait_for(lambda: heard.extend(task.worker.records() if task.worker else []) or heard, look=not task.worker)
    assert all(0 <= time.monotonic() - record["heard"] < panel.SECONDS_TO_RENDER for record in heard)
    for fraction, moment in ((0.0, 100.0), (0.5, 110.0)):
        task._take({"stage": "render", "fraction": fraction, "heard": moment})
    assert task._clock.worked(130.0) == pytest.approx(30.0)
    session.cancel()


def test_no_task_to_cancel(scene):
    assert bpy.ops.lfsr.cancel() == {"CANCELLED"}
