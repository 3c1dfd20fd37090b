"""The task under way: one process, its progress, cancel, and a process that dies."""

import dataclasses
import functools
import os
import re
import signal
import sys
import time
from pathlib import Path

import bpy
import pytest

from blender_addon.jobs import asked, session, task
from blender_addon.jobs.task import Job, Task
from blender_addon.scene import folders
from blender_addon.scene.words import sentence
from blender_addon.ui.operators import render
from lfsr_core.base.notices import Notice, Progress
from lfsr_core.reconstruct.methods import DEFAULT_METHOD
from lfsr_core.tasks.runner import TASKS
from tests.support import panel
from tests.support.processes import children

ROOT = Path(__file__).resolve().parents[3]
LONG = 100_000  # samples per pixel, so that a render is under way when it is stopped


def start(scene: bpy.types.Scene, finish=print) -> Task:
    """What *Render EIA* starts, with another end."""
    return session.start("Render EIA", dataclasses.replace(render.image_job(scene), finish=finish))


def message() -> tuple[str, bool]:
    state = bpy.context.window_manager.lfsr
    return state.message, state.message_is_error


def test_cancel_while_rendering_is_quick_and_leaves_nothing(scene):
    scene.lfsr.samples = LONG
    before = panel.snapshot(scene)
    task = start(scene, lambda _: pytest.fail("it finished"))
    panel.wait_for(lambda: task.progress.stage == "render")
    started = time.perf_counter()
    assert bpy.ops.lfsr.cancel() == {"FINISHED"}
    seconds = time.perf_counter() - started
    print(f"cancel: {seconds:.2f} s")
    assert seconds < 2 and session.current() is None and message() == ("Cancelled", False)
    assert panel.snapshot(scene) == before
    assert list(folders.scene_folder(scene).iterdir()) == []
    assert not list(Path(bpy.app.tempdir).glob("lfsr-*/*"))
    assert bpy.ops.lfsr.cancel() == {"CANCELLED"}, "there is nothing to cancel any more"


def test_a_render_that_is_cancelled_in_its_second_stage_is_kept(scene):
    scene.lfsr.display, scene.lfsr.scale, scene.lfsr.method = "fhd", "5", DEFAULT_METHOD  # some seconds of denoising
    task = start(scene, lambda _: pytest.fail("it finished"))
    panel.wait_for(lambda: task.progress.stage not in ("save", "open", "render"))
    assert bpy.ops.lfsr.cancel() == {"FINISHED"}
    folder = folders.frame_folder(scene)
    assert folders.is_unfinished(folder) and "The render is kept" in message()[0]
    assert [path.name for path in folder.parent.iterdir()] == [folder.name]


def test_a_process_that_dies_is_reported(scene):
    before, task = panel.snapshot(scene), start(scene)
    panel.wait_for(lambda: task.child)
    os.killpg(task.child.pid, signal.SIGKILL)
    panel.wait_for(lambda: session.current() is None)
    assert "Render EIA stopped with signal 9" in message()[0] and message()[1]
    assert panel.snapshot(scene) == before
    panel.wait_for(lambda: list(folders.scene_folder(scene).iterdir()) == [])


@pytest.mark.skipif(sys.platform != "linux", reason="looks for the process's own")
def test_a_killed_blender_is_one_sentence(scene):
    scene.lfsr.samples = LONG
    task = start(scene)
    panel.wait_for(lambda: task.progress.stage == "render")
    for pid in children(task.child.pid):
        os.kill(pid, signal.SIGKILL)
    panel.wait_for(lambda: session.current() is None)
    assert "Blender stopped with signal 9" in message()[0] and message()[1]


@pytest.mark.skipif(sys.platform != "linux", reason="looks for the process's own")
def test_the_processes_leave_cores_to_others_and_end_with_this_one(scene):
    scene.lfsr.samples = LONG
    task = start(scene)
    panel.wait_for(lambda: task.progress.stage == "render")
    (blender,) = children(task.child.pid)
    lower = os.getpriority(os.PRIO_PROCESS, 0) + 5
    assert os.getpriority(os.PRIO_PROCESS, task.child.pid) > lower < os.getpriority(os.PRIO_PROCESS, blender)
    task.child._process.stdin.close()  # as the end of this process does
    panel.wait_for(lambda: not Path(f"/proc/{blender}").exists(), look=False)
    session.cancel()


def test_a_render_that_worked_is_one_quiet_line(scene, monkeypatch):
    popups = []
    monkeypatch.setattr(session, "tell", lambda *said: popups.append(said))
    state = bpy.context.window_manager.lfsr
    state.message = "of the last render"
    task = session.start("Render EIA", render.image_job(scene))
    task.notices += [Notice("sequencer-ignored")]
    panel.wait_for(lambda: session.current() is None)
    assert re.fullmatch(r"Done in \d:\d\d", state.outcome) and popups == []
    assert state.outcome_folder == str(folders.frame_folder(scene))
    assert message() == (sentence(Notice("sequencer-ignored")), False)
    assert asked.is_decoded(folders.frame_folder(scene)) and asked.is_made(*asked.asked(scene))


def test_a_file_that_is_opened_meanwhile_stays_as_it_is(scene):
    task = start(scene, lambda _: pytest.fail("it belongs to the other file"))
    panel.wait_for(lambda: task.child)
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
    panel.wait_for(lambda: session.current() is None)
    assert task.ended and (folders.frame_folder(bpy.context.scene) / "eia.png").is_file(), "but its image is saved"


def test_a_cancelled_animation_can_be_continued(scene):
    task = session.start("Render Animation", render.animation_job(scene))
    panel.wait_for(lambda: task.child)
    assert bpy.ops.lfsr.cancel() == {"FINISHED"}
    assert message()[0] == f"Cancelled. {asked.CONTINUE}"


def test_saving_is_announced_before_blender_stops_for_it(scene, monkeypatch):
    saved = []
    monkeypatch.setattr(task, "save_copy", lambda path: saved.append(path) or path.touch() or path)
    running = start(scene)
    assert (saved, running.child, running.ended) == ([], None, False)
    assert session.progress_text(running) == session.TITLES["save"]
    assert bpy.ops.lfsr.cancel() == {"FINISHED"} and running.ended and not saved
    running = start(scene)
    session._look()
    assert len(saved) == 1 and running.child and session.progress_text(running) == session.TITLES["open"]
    session.cancel()


def test_a_copy_has_no_preview_image_and_the_preferences_stay(scene, tmp_path):
    preferences, seen = bpy.context.preferences, []
    before = preferences.filepaths.file_preview_type, preferences.is_dirty
    assert before[0] != "NONE"

    def note(*_: object) -> None:
        seen.append(preferences.filepaths.file_preview_type)
    bpy.app.handlers.save_pre.append(note)
    task.save_copy(tmp_path / "copy.blend")
    bpy.app.handlers.save_pre.remove(note)
    assert seen == ["NONE"] and (tmp_path / "copy.blend").is_file()
    assert (preferences.filepaths.file_preview_type, preferences.is_dirty) == before


def test_a_copy_that_cannot_be_saved_ends_the_task(scene, monkeypatch):
    monkeypatch.setattr(task, "save_copy", functools.partial(task.save_copy, Path("/no/such/folder/copy.blend")))
    monkeypatch.setattr(task, "_kept_copy", lambda _: task.save_copy())
    running = start(scene)
    panel.wait_for(lambda: session.current() is None)
    assert running.ended and "cannot be saved" in message()[0] and message()[1]


def test_every_stage_that_the_panel_hears_has_a_title():
    told = {found for package in ("lfsr_core", "blender_addon") for path in (ROOT / package).rglob("*.py")
            for found in re.findall(r'Progress\("(\w+)"', path.read_text(encoding="utf-8"))}
    assert (told | set(TASKS)) - {"import", "merge", "make"} <= set(session.TITLES)


def test_progress_and_time_left_run_on_between_reports(monkeypatch):
    now = 100.0
    monkeypatch.setattr(task.time, "monotonic", lambda: now)
    running = Task("Render EIA", Job("make", {}, print))
    running._take(now, {"stage": "render", "fraction": 0.0, "message": "Sample 0/4"})
    assert running.seconds_left is None and session.progress_text(running) == "Rendering 0%"
    running._take(now, {"stage": "render", "fraction": 0.4, "message": "Sample 2/4", "left": 30.0})
    assert running.seconds_left == 30.0 and session.progress_text(running) == "Rendering 40%, 0:30 left"
    now += 10
    repeated = {"stage": "render", "fraction": 0.4, "message": "Sample 2/4, for 10 s", "left": 30.0, "repeated": True}
    running._take(now, repeated)
    assert running.seconds_left == pytest.approx(20.0) and running.fraction == pytest.approx(0.6)
    assert running.progress == Progress("render", 0.4, "Sample 2/4, for 10 s", 30.0, repeated=True)
    now += 25
    assert running.seconds_left > 0, "what is late takes some more"
    running._take(now, {"stage": "write", "fraction": 0.5, "message": "", "left": None})
    assert running.seconds_left is None and running.fraction >= 0.6, "it never falls"


def test_notices_are_told_once_and_those_of_a_job_are_its_own():
    heard = []
    running = Task("Render EIA", Job("make", {}, print, lambda told: told.code == "own" and not heard.append(told)))
    for code in ("own", "other", "other"):
        running._take(0.0, {"stage": "notice", "notice": code, "values": {}})
    assert [told.code for told in heard] == ["own"] and running.notices == [Notice("other")]
