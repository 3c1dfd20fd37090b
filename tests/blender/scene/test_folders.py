"""Whose images a folder holds: of this file and this scene, or of others."""

import shutil
from pathlib import Path

import bpy
import pytest

from blender_addon.jobs import folders, session
from lfsr_core.base.messages import LfsrError
from lfsr_core.base.system import read_json, write_json
from lfsr_core.images.image_files import read_png
from tests.support import panel
from tests.support.scenes import add_box

pytestmark = pytest.mark.usefixtures("add_on")


def save(path: Path) -> None:
    path.parent.mkdir(exist_ok=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))


def render() -> Path:
    assert bpy.ops.lfsr.render_eia() == {"FINISHED"}
    return folders.frame_folder(bpy.context.scene)


@pytest.fixture(scope="module")
def rendered(tmp_path_factory) -> Path:
    """A file ``shot.blend`` whose frame 1 is rendered."""
    folder = tmp_path_factory.mktemp("shots")
    panel.artist_scene(None)
    save(folder / "shot.blend")
    render()
    return folder / "shot.blend"


@pytest.fixture
def project(rendered, tmp_path) -> Path:
    """A copy of ``rendered`` with its results, opened."""
    shutil.copytree(rendered.parent, tmp_path / "project")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "project" / "shot.blend"))
    return tmp_path / "project"


def is_mine() -> bool:
    try:
        return folders.finished_frame(bpy.context.scene, "to preview").is_dir()
    except LfsrError:
        return False


def test_two_files_in_one_folder_have_their_own_results(project):
    first = read_png(folders.frame_folder(bpy.context.scene) / "eia.png")
    add_box(bpy.context.scene, (0.3, 0.0, 0.0), (0.4, 0.4, 0.4))
    save(project / "other.blend")
    assert not is_mine()
    panel.refused("There is no image in .*other/Scene/0001 to preview: render the EIA first", bpy.ops.lfsr.preview_view)
    bpy.context.scene.frame_end = 1
    assert bpy.ops.lfsr.render_animation() == {"FINISHED"}
    assert (read_png(project / "lightfield" / "other" / "Scene" / "0001" / "eia.png") != first).any()
    assert (read_png(project / "lightfield" / "shot" / "Scene" / "0001" / "eia.png") == first).all()


def test_a_file_of_one_name_elsewhere_does_not_take_results(project, tmp_path):
    scene = bpy.context.scene
    scene.lfsr.output, scene.frame_end = str(tmp_path / "renders"), 1
    save(project / "shot.blend")
    mine = read_png(render() / "eia.png")
    add_box(scene, (0.3, 0.0, 0.0), (0.4, 0.4, 0.4))
    save(tmp_path / "elsewhere" / "shot.blend")
    assert not is_mine() and not folders.is_made(*folders.requested(scene))
    taken = "Frame 0001 .* is an image of another scene, 'Scene' of shot.blend in the folder project: "
    for operator in (bpy.ops.lfsr.render_eia, bpy.ops.lfsr.render_animation):
        panel.refused(f"{taken}turn on Overwrite, or choose another output folder", operator)
    for operator in (bpy.ops.lfsr.preview_view, bpy.ops.lfsr.open_viewer, bpy.ops.lfsr.render_reference):
        panel.refused(f"{taken}render the EIA first, or choose another output folder", operator)
    assert (read_png(folders.frame_folder(scene) / "eia.png") == mine).all()
    scene.lfsr.use_overwrite = True
    assert bpy.ops.lfsr.render_animation() == {"FINISHED"}
    assert is_mine() and (read_png(folders.frame_folder(scene) / "eia.png") != mine).any()


def test_scenes_whose_names_are_cleaned_to_one_are_told_apart_and_a_renamed_file_takes_no_others_results(project):
    assert is_mine(), "a project that was moved keeps them"
    (project / "shot.blend").rename(project / "hero.blend")
    bpy.ops.wm.open_mainfile(filepath=str(project / "hero.blend"))
    assert not is_mine()
    (project / "lightfield" / "shot").rename(project / "lightfield" / "hero")
    assert not is_mine()  # whether it is the same file cannot be known
    (scene := bpy.context.scene).name = "Set A"
    assert render().parent.name == "Set_A" and is_mine()
    scene.name = "Set_A"
    assert not is_mine()


def test_a_file_that_was_never_saved_knows_its_results(tmp_path):
    panel.artist_scene(None).lfsr.output = str(tmp_path)
    assert render() == tmp_path / "untitled" / "Scene" / "0001" and is_mine()
    panel.artist_scene(None).lfsr.output = str(tmp_path)
    assert not is_mine()
    panel.refused("'Scene' of a file that was never saved: turn on Overwrite", bpy.ops.lfsr.render_eia)


def test_relative_output_folders_and_names_in_any_script(project):
    for output in ("//lightfield/", "//", "", "//../images"):
        bpy.context.scene.lfsr.output = output
        folder, root = folders.frame_folder(bpy.context.scene), project / "x" / ".." / bpy.path.abspath(output or "//")
        assert folder.is_absolute() and folder.resolve() == root.resolve() / "shot/Scene/0001"
    assert render() == folder and is_mine()
    bpy.context.scene.name = "场景"
    save(project / "镜头.blend")
    assert folders.frame_folder(bpy.context.scene).parts[-3:] == ("镜头", "场景", "0001")


def test_what_was_rendered_before_the_first_save_moves_beside_the_file(scene, tmp_path, monkeypatch):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    older = folders._unsaved(scene) / folders.UNSAVED / "Scene" / "0001"
    older.mkdir(parents=True)
    write_json(older / "frame.json", {"source": folders.source_of(scene), "spp": 3})
    monkeypatch.setattr(session, "_current", object())
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "late.blend"))
    assert older.exists(), "a task is at work on it"
    monkeypatch.setattr(session, "_current", None)
    session._saved()
    moved = folders.frame_folder(scene, 1)
    assert not older.exists() and moved == tmp_path / "lightfield" / "late" / "Scene" / "0001"
    assert read_json(moved / "frame.json", "a frame") == {"source": folders.source_of(scene), "spp": 3}
