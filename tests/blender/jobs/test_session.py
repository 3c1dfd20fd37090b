"""The task under way: one process, its progress, cancel, and a process that dies."""

import dataclasses
import functools
import os
import re
import shutil
import signal
import sys
import time
from pathlib import Path

import bpy
import numpy as np
import pytest

from blender_addon.jobs import folders, images, runtime, session
from blender_addon.jobs.runtime import file_copy
from blender_addon.jobs.session import Job, Task
from blender_addon.scene.files import unreadable
from blender_addon.scene.words import sentence
from blender_addon.ui.operators import render
from lfsr_core.base.messages import Notice, Progress
from lfsr_core.frames.folder import FrameFolder, scene_stamp
from lfsr_core.images.image_files import write_layers, write_png
from lfsr_core.reconstruct.methods import DEFAULT_METHOD
from lfsr_core.tasks.runner import TASKS
from tests.support import panel
from tests.support.processes import children, lives
from tests.support.scenes import ROOT, snapshot

LONG = 100_000  # samples per pixel, so that a render is under way when it is stopped


def start(scene: bpy.types.Scene, finish=print) -> Task:
    """What *Render EIA* starts, with another end."""
    return session.start("Render EIA", dataclasses.replace(render.image_job(scene), finish=finish))


def message() -> tuple[str, bool]:
    state = bpy.context.window_manager.lfsr
    return state.message, state.message_is_error


def test_cancel_while_rendering_is_quick_and_leaves_nothing(scene):
    scene.lfsr.samples = LONG
    shutil.rmtree(bpy.app.tempdir)  # as a program that tidies does
    before, task = snapshot(), start(scene, lambda _: pytest.fail("it finished"))
    panel.wait_for(lambda: task.progress.stage == "render")
    pid, started = task.child.pid, time.perf_counter()
    assert bpy.ops.lfsr.cancel() == {"FINISHED"} and time.perf_counter() - started < 2 and not lives(pid)
    assert session.current() is None and message() == ("Cancelled", False)
    assert snapshot() == before
    assert list(folders.scene_folder(scene).iterdir()) == [] and not list(Path(bpy.app.tempdir).glob("lfsr-*/*"))
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
    before, task = snapshot(), start(scene)
    panel.wait_for(lambda: task.child)
    os.killpg(task.child.pid, signal.SIGKILL)
    panel.wait_for(lambda: session.current() is None)
    assert "Render EIA stopped with signal 9" in message()[0] and message()[1]
    assert snapshot() == before
    panel.wait_for(lambda: list(folders.scene_folder(scene).iterdir()) == [])


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
    session.start("Render EIA", render.image_job(scene)).notices += [Notice("sequencer-ignored")]
    panel.wait_for(lambda: session.current() is None)
    assert re.fullmatch(r"Done in \d:\d\d", state.outcome) and popups == []
    assert state.outcome_folder == str(folders.frame_folder(scene))
    assert message() == (sentence(Notice("sequencer-ignored")), False)
    assert folders.is_decoded(folders.frame_folder(scene)) and folders.is_made(*folders.requested(scene))


def test_a_file_that_is_opened_meanwhile_stays_as_it_is(scene):
    task = start(scene, lambda _: pytest.fail("it belongs to the other file"))
    panel.wait_for(lambda: task.child)
    state, told = bpy.context.window_manager.lfsr, ("message", "outcome", "outcome_folder", "plan_scene", "probe_scene")
    for name in told:
        setattr(state, name, scene.name_full)
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath, load_ui=False)
    assert not any(getattr(bpy.context.window_manager.lfsr, name) for name in told), "they are of the other scene"
    panel.wait_for(lambda: session.current() is None)
    assert task.ended and (folders.frame_folder(bpy.context.scene) / "eia.png").is_file(), "but its image is saved"
    assert not any(getattr(bpy.context.window_manager.lfsr, name) for name in told) and task.job.notice(Notice("any"))


def test_a_cancelled_animation_can_be_continued_and_saving_is_announced_before_blender_stops_for_it(scene, monkeypatch):
    task = session.start("Render Animation", render.animation_job(scene))
    panel.wait_for(lambda: task.child)
    assert bpy.ops.lfsr.cancel() == {"FINISHED"} and message()[0] == f"Cancelled. {folders.CONTINUE}"
    saved = []
    monkeypatch.setattr(runtime, "save_copy", lambda path: saved.append(path) or path.touch() or path)
    running = start(scene)
    assert (saved, running.child, running.ended) == ([], None, False)
    assert session.progress_text(running) == session.TITLES["save"]
    assert bpy.ops.lfsr.cancel() == {"FINISHED"} and running.ended and not saved
    running = start(scene)
    session._look()
    assert len(saved) == 1 and running.child and session.progress_text(running) == session.TITLES["open"]
    session.cancel()


def test_a_copy_without_preview_leaves_the_preferences_and_one_that_cannot_be_saved_ends_the_task(scene, tmp_path,
                                                                                                  monkeypatch):
    preferences, seen = bpy.context.preferences, []
    before = preferences.filepaths.file_preview_type, preferences.is_dirty
    assert before[0] != "NONE"

    def note(*_: object) -> None:
        seen.append(preferences.filepaths.file_preview_type)
    bpy.app.handlers.save_pre.append(note)
    runtime.save_copy(tmp_path / "copy.blend")
    bpy.app.handlers.save_pre.remove(note)
    assert seen == ["NONE"] and (tmp_path / "copy.blend").is_file()
    assert (preferences.filepaths.file_preview_type, preferences.is_dirty) == before
    monkeypatch.setattr(runtime, "save_copy", functools.partial(runtime.save_copy, Path("/no/such/folder/copy.blend")))
    monkeypatch.setattr(runtime, "_kept_copy", lambda _: runtime.save_copy())
    running = start(scene)
    panel.wait_for(lambda: session.current() is None)
    assert running.ended and "cannot be saved" in message()[0] and message()[1]


def test_every_stage_has_a_title_and_notices_are_told_once_those_of_a_job_its_own():
    told = {stage for package in ("lfsr_core", "blender_addon") for path in (ROOT / package).rglob("*.py")
            for stage in re.findall(r'Progress\("(\w+)"', path.read_text(encoding="utf-8"))}
    assert (told | set(TASKS)) - {"import", "merge", "make"} <= set(session.TITLES)
    heard = []
    running = Task("Render EIA", Job("make", {}, print, lambda told: told.code == "own" and not heard.append(told)))
    for code in ("own", "other", "other"):
        running._take(0.0, {"stage": "notice", "notice": code, "values": {}})
    assert [told.code for told in heard] == ["own"] and running.notices == [Notice("other")]


def test_progress_and_time_left_run_on_between_reports(monkeypatch):
    now = 100.0
    monkeypatch.setattr(session.time, "monotonic", lambda: now)
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


class _StopError(Exception):
    pass


@pytest.fixture
def output(tmp_path):
    """Folder of a render that left a part."""
    write_layers(FrameFolder(tmp_path / "frame").parts / "lr_eia-digest-000000-000002-100.exr",
                 {"color": np.zeros((2, 4, 4), np.float32)})
    return tmp_path / "frame"


def cancelled(output):
    """Stamp and place of the copy that a render used which then ended early."""
    with pytest.raises(_StopError), file_copy(output) as copy:
        identity = scene_stamp(copy), copy, copy.stat().st_ino
        raise _StopError
    return identity


def save(path=None):
    bpy.ops.wm.save_as_mainfile(filepath=str(path or bpy.data.filepath))


def reopen():
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)


def click():
    box = bpy.data.objects["Box"]
    box.select_set(not box.select_get())
    bpy.context.view_layer.objects.active = bpy.data.objects["Sun"]
    bpy.context.scene.cursor.location.x += 1


def edit():
    bpy.data.objects["Box"].location.z += 0.01
    bpy.data.objects["Box"].modifiers.new("baked", "NODES").bake_directory = "//baked"  # which the copy has otherwise


SAME = {"nothing": (), "saved twice": (save, save), "clicked": (click,), "clicked and saved": (click, save),
        "reopened": (reopen,), "reopened and clicked": (reopen, click), "saved and reopened": (save, reopen)}


@pytest.mark.parametrize("unsaved", [False, True])
@pytest.mark.parametrize("steps", SAME)
def test_it_is_used_again_where_nothing_was_edited(scene, output, steps, unsaved):
    if unsaved:
        edit()
    first = cancelled(output)
    if unsaved and reopen in SAME[steps] and save not in SAME[steps]:
        pytest.skip("reopening loses the edit")
    for step in SAME[steps]:
        step()
    with file_copy():
        pass
    bpy.context.scene.frame_set(bpy.context.scene.frame_current + 3)
    assert cancelled(output) == first


def without_collection(scene):
    scene.collection.children.link(bpy.data.collections.new("made"))
    bpy.context.view_layer.layer_collection.children["made"].exclude = True


def paint(scene):
    material = bpy.data.materials.new("paint")
    bpy.data.objects["Box"].data.materials.append(material)
    material.diffuse_color = (1, 0, 0, 1)


def there_and_back(scene):
    edit()
    bpy.context.view_layer.update()
    bpy.data.objects["Box"].location.z -= 0.01


CHANGES = {
    "move": lambda scene: edit(), "without collection": without_collection, "paint": paint, "back": there_and_back,
    "bounces": lambda scene: setattr(scene.cycles, "max_bounces", scene.cycles.max_bounces + 1),
    "cut": lambda scene: setattr(scene.timeline_markers.new("cut", frame=1), "camera", scene.camera),
    "hair": lambda scene: setattr(scene.cycles_curves, "shape", "THICK"),
    "exposure": lambda scene: setattr(scene.view_settings, "exposure", 1.0),
    "hide": lambda scene: setattr(bpy.data.objects["Box"], "hide_render", True),
    "dent": lambda scene: setattr(bpy.data.objects["Box"].data.vertices[0], "co", (9, 9, 9)),
    "key": lambda scene: bpy.data.objects["Box"].keyframe_insert("location", frame=3)}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_an_edit_makes_a_new_one(scene, output, change):
    first = cancelled(output)
    click()
    change(scene)
    second = cancelled(output)
    assert second != first and second[1] == first[1]
    save()
    assert cancelled(output) == second


def test_another_image_in_a_material_makes_a_new_one(scene, output, tmp_path):
    image = bpy.data.images.new("wood", 4, 4)
    paint(scene)
    bpy.data.materials["paint"].node_tree.nodes.new("ShaderNodeTexImage").image = image
    first = cancelled(output)
    bpy.data.images.new("shown", 4, 4).filepath = str(tmp_path / "eia.png")
    assert cancelled(output) == first, "what is shown in an editor does not count"
    image.colorspace_settings.name = "Non-Color"
    assert cancelled(output) != first


def test_copies_of_one_state_have_one_stamp_and_another_file_opened_makes_a_new_one(scene, output, tmp_path):
    first = cancelled(output)
    first[1].unlink()
    again = cancelled(output)
    assert again[0] == first[0], "finished frames of an animation are not taken for older"
    first = again
    edit()
    save(tmp_path / "other.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert cancelled(output) == first
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "other.blend"))
    assert cancelled(output)[0] != first[0]
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    runtime._opened(str(tmp_path / "auto.blend"))  # as where that is recovered, which has the path of the older file
    assert cancelled(output)[0] != first[0]


def test_it_goes_with_the_render_and_where_no_parts_are_left(scene, output, tmp_path):
    with file_copy(output) as copy:
        assert copy.is_file() and copy.name == "scene.blend"
        with file_copy(output) as other:
            assert other.parent != copy.parent
        assert copy.is_file(), "two Blenders render into one folder"
    assert not copy.exists() and FrameFolder(output).parts.exists()
    assert not cancelled(tmp_path / "other")[1].exists() and not FrameFolder(tmp_path / "other").parts.exists()
    film = tmp_path / "film"
    write_layers(FrameFolder(film / "0003").parts / "lr_eia-digest-000000-000002-100.exr",
                 {"color": np.zeros((2, 4, 4), np.float32)})
    assert cancelled(film)[1].exists()
    with file_copy() as copy:
        assert copy.is_file()
    assert not copy.parent.exists()


def test_a_preview_shows_the_view_without_a_mapped_file_or_an_image_to_save(scene, tmp_path):
    views, path = np.random.default_rng(0).integers(0, 255, (8, 8, 54, 96, 3), np.uint8), tmp_path / "views.npy"
    np.save(path, views)
    images.load(scene, path)
    scene.lfsr.eye_right = 1
    maps = Path("/proc/self/maps")
    assert not maps.is_file() or str(path) not in maps.read_text(), "Windows replaces no mapped file"
    image = bpy.data.images[images.IMAGE_NAME]
    assert not any(item.is_dirty for item in bpy.data.images), "Blender asks about it when it quits"
    shown = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(shown)
    expected = images.to_pixels(views[images.view_index((8, 8), (1, scene.lfsr.eye_up))])
    assert np.abs(shown - expected.ravel()).max() < 1e-3 and len(bpy.data.images) == 1


def test_our_images_stay_out_of_the_file(scene, tmp_path):
    np.save(tmp_path / "views.npy", np.full((2, 2, 3, 4, 3), 255, np.uint8))
    write_png(tmp_path / "panel.png", np.zeros((4, 4, 3), np.uint8))
    images.load(scene, tmp_path / "views.npy")
    for image in (images.show(scene, (0, 0)), images.open_file(tmp_path / "panel.png")):
        image.use_fake_user = True  # as if an editor showed it
    (tmp_path / "panel.png").unlink()
    assert not unreadable(bpy.context.scene)
    write_png(tmp_path / "kept.png", np.zeros((4, 4, 3), np.uint8))
    texture = bpy.data.textures.new("of the artist", "IMAGE")
    texture.image, texture.use_fake_user = images.open_file(tmp_path / "kept.png"), True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert len(bpy.data.images) == 3, "they stay in this session"
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert list(bpy.data.images) == [bpy.data.textures["of the artist"].image]


def test_an_image_of_the_same_name_is_the_artists(scene, tmp_path):
    own = bpy.data.images.new(images.IMAGE_NAME, 4, 4)
    own.filepath_raw, own.file_format = str(tmp_path / "own.png"), "PNG"
    own.save()
    np.save(tmp_path / "views.npy", np.full((2, 2, 3, 4, 3), 255, np.uint8))
    images.load(scene, tmp_path / "views.npy")
    assert images.show(scene, (0, 0)) != own and tuple(own.size) == (4, 4)
