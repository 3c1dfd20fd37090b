"""Bad input: one clear sentence, nothing rendered, the scene as it was."""

import resource
import signal
from pathlib import Path
from types import SimpleNamespace

import bpy
import pytest

from blender_addon.check import last
from blender_addon.jobs import folders, session
from blender_addon.scene.files import choose_scene
from blender_addon.ui import panels
from blender_addon.ui.operators import render
from lfsr_core.frames.frame import read_frame
from tests.blender.ui.test_panels import draw, labels
from tests.support import panel
from tests.support.scenes import link, snapshot
from tests.support.told import refuses


def refuse(scene, sentence: str, operator=None) -> None:
    """The operator is cancelled with a report that matches, and the scene is as it was."""
    before = snapshot()
    panel.refused(sentence, operator or bpy.ops.lfsr.render_eia)
    assert snapshot() == before and session.current() is None


@pytest.fixture
def library(tmp_path):
    """A file with a collection "Prop" that holds a camera array and a box, linked by the tests."""
    with panel.registered():
        scene, prop = panel.artist_scene(None), bpy.data.collections.new("Prop")
        scene.collection.children.link(prop)
        for name in ("Box", "Light Field Array", "Display Plane"):
            prop.objects.link(bpy.data.objects[name])
        path = str(tmp_path / "library.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path)
    return path


@pytest.mark.parametrize(("spoil", "sentence"), [
    (lambda scene: bpy.data.objects.remove(bpy.data.objects["Display Plane"]), "has no display plane"),
    (lambda scene: bpy.data.batch_remove(list(scene.objects)), "is empty: add or import an object to render$"),
    (lambda scene: (scene.copy(), [scene.collection.objects.unlink(item) for item in [*scene.objects]]),
     r"or choose scene '.*001'"),
    (lambda scene: setattr(bpy.data.objects["Box"], "hide_render", True), "Nothing of the subject"),
    (lambda scene: setattr(scene.lfsr, "display", "FILE"), "No display profile is chosen"),
    (lambda scene: setattr(scene.lfsr, "scale", "5"), "Scale is 5, .* choose a scale that divides both"),
    (lambda scene: setattr(scene.lfsr, "method", "denoise"), "Method 'denoise' upscales nothing, but scale 2")])
def test_what_cannot_be_rendered_is_refused_before_the_render(scene, monkeypatch, spoil, sentence):
    monkeypatch.setattr(session, "run", lambda *_: pytest.fail("it renders"))
    spoil(scene)
    refuse(scene, sentence)


@pytest.mark.parametrize("name", ["render_eia", "array_add", "array_fit", "array_remove", "check_scene", "live"])
def test_the_live_windows_own_scene_is_not_changed(scene, name):
    scene["lfsr_live"] = "panel"
    refuse(scene, "shows the light field itself: press", getattr(bpy.ops.lfsr, name))


def test_linked_and_overridden_arrays_cannot_be_changed(library, scene):
    bpy.ops.lfsr.array_remove()
    (collection,) = link(library, "collections", ["Prop"])
    scene.collection.children.link(collection)
    bpy.context.view_layer.update()
    bpy.data.objects["Box"].select_set(True)
    refuse(scene, "is linked from library.blend: make it local first", bpy.ops.lfsr.array_fit)
    refuse(scene, "is linked from library.blend", bpy.ops.lfsr.array_remove)
    assert collection.override_hierarchy_create(scene, bpy.context.view_layer, do_fully_editable=False)
    scene.collection.children.unlink(collection)
    bpy.data.objects["Box"].select_set(True)
    refuse(scene, "library override that is not editable", bpy.ops.lfsr.array_fit)


def test_unsaved_file(tmp_path):
    with panel.registered():
        scene = panel.artist_scene(None)
        refuse(scene, "this file is not saved yet: save it or choose another folder")
        last.check(scene)
        assert "unsaved" in [line.code for line in last.rows]


@pytest.mark.parametrize(("folder", "sentence"), [
    # Not even the superuser can make files there.
    ("/sys/lfsr", "cannot be written .*: choose a folder you may write to"), ("taken", "cannot be written"),
    ("x" * 256, "is too long"), ("link", "is a link to .*nowhere")])
def test_output_that_cannot_be(scene, tmp_path, folder, sentence):
    (tmp_path / "taken").write_text("x")
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    scene.lfsr.output = str(tmp_path / folder)
    refuse(scene, sentence)
    assert "output" in [problem.code for problem in last.check(scene)]


def test_a_full_disk_is_noticed_before_anything_is_rendered(scene, tmp_path):
    """With a limit on the size of files, as a quota sets it."""
    limits, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (folders.PROBE_BYTES // 2, limits[1]))
    try:
        refuses("cannot be written .*free some space", folders.try_output, scene)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)
    folders.try_output(scene)
    assert not (tmp_path / "lightfield").exists(), "what was tried leaves nothing"


def test_a_missing_texture_is_said_and_the_render_goes_on(scene, tmp_path):
    material = bpy.data.materials.new("Textured")
    material.use_nodes = True
    texture = material.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = bpy.data.images.new("Gone", 4, 4)
    texture.image.source, texture.image.filepath = "FILE", "//textures/gone.png"
    bpy.data.objects["Box"].data.materials.append(material)
    task = session.run("Render EIA", render.image_job(scene))
    assert [notice for notice in task.notices if "gone.png" in str(notice.values)]
    kept = read_frame(tmp_path / "lightfield" / "scene" / "Scene" / "0001").notes
    assert [notice.code for notice in kept] == ["file-unreadable"], "said once"


def test_render_already_running(scene, monkeypatch):
    task = session.start("Render EIA", render.image_job(scene))
    for operator in (bpy.ops.lfsr.render_eia, bpy.ops.lfsr.render_animation, bpy.ops.lfsr.render_reference,
                     bpy.ops.lfsr.preview_view):
        panel.refused("Render EIA is still running: wait for it or cancel it", operator)
    assert session.current() is task
    session.cancel()
    monkeypatch.setattr(session.bpy, "app", SimpleNamespace(is_job_running=lambda kind: kind == "RENDER"))
    with pytest.raises(Exception, match="Blender is rendering"):
        session.check_idle()


def test_two_scenes_with_different_displays(scene, tmp_path):
    bpy.ops.scene.new(type="LINK_COPY")
    other = bpy.context.window.scene
    other.name = "Other"
    assert other != scene
    refuses("no scene 'Gone': choose one of Other, Scene", choose_scene, "Gone")
    other.lfsr.display, other.lfsr.scale = "small", "8"
    other.view_settings.exposure = 1.5
    requests = [request for request, _ in map(folders.requested, (scene, other))]
    assert [request.display.name for request in requests] == ["mini", "small"]
    assert [Path(request.output).parent.name for request in requests] == ["Scene", "Other"]
    bpy.context.window.scene = scene
    with bpy.context.temp_override(scene=other):
        assert bpy.ops.lfsr.render_eia() == {"FINISHED"}
    assert bpy.context.window.scene == scene
    frame = read_frame(tmp_path / "lightfield" / "scene" / "Other" / "0001")
    assert (frame.display.name, frame.color.exposure) == ("small", 1.5)
    assert not (tmp_path / "lightfield" / "scene" / "Scene").exists()


def test_cycles_disabled(scene):
    bpy.ops.preferences.addon_disable(module="cycles")
    try:
        refuse(scene, "Cycles is switched off in Blender's preferences: switch .* on")
        last.check(scene)
        bpy.context.window_manager.lfsr.show_problems = True
        assert "Cycles" in labels(draw(panels.LFSR_PT_image))
    finally:
        bpy.ops.preferences.addon_enable(module="cycles")
