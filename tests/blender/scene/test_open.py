"""Files into scenes: every format, and what is refused."""

import importlib
import json

import bpy
import numpy as np
import pytest

from blender_addon.render import frame_folder
from blender_addon.scene import contents
from blender_addon.scene.array import edit, placement, rig
from blender_addon.scene.contents import find_subject
from blender_addon.scene.files import camera_notices, choose_camera, open_scene
from lfsr_core.commands.sentences import sentence
from lfsr_core.frames.frame import read_frame
from lfsr_core.images import image_files
from tests.support.requests import make_request
from tests.support.scenes import MINI, add_box, add_camera, emission, fresh_scene, save_box
from tests.support.told import refuses

# Box of the test files: not centred, not a cube, deeper than wide in no axis.
CENTRE, HALF = np.array((1.0, 2.0, 3.0)), np.array((0.5, 0.3, 0.4))

# A mesh of points that are nowhere.
BAD_ACCESSOR = """{"asset": {"version": "2.0"}, "meshes": [{"primitives": [{"attributes": {"POSITION": 99}}]}],
    "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0}"""


@pytest.mark.parametrize("suffix", [".blend", ".glb", ".gltf", ".obj"])
def test_every_format_puts_the_box_where_it_was(tmp_path, suffix):
    scene = open_scene(save_box(tmp_path / f"scene{suffix}", tuple(CENTRE), tuple(HALF)))
    low, high = placement.bounds(find_subject(scene))
    assert low == pytest.approx(CENTRE - HALF, abs=1e-5) and high == pytest.approx(CENTRE + HALF, abs=1e-5)


@pytest.mark.parametrize("suffix", [".blend", ".glb", ".gltf", ".obj"])
def test_a_truncated_file_and_one_of_nonsense_are_refused(tmp_path, suffix):
    path = save_box(tmp_path / f"scene{suffix}", tuple(CENTRE), tuple(HALF))
    if suffix != ".obj":
        path.write_bytes(path.read_bytes()[:path.stat().st_size // 3])
        refuses(f"scene{suffix} cannot be read", open_scene, path)
    path.write_bytes(b"\x00nonsense" * 100)
    refuses("cannot be read|nothing of the subject|is empty", lambda: find_subject(open_scene(path)))


def test_an_importers_long_traceback_is_one_short_sentence(tmp_path):
    """Blender cuts what its importer says, and then adds where it called it from."""
    path = tmp_path / "scene.gltf"
    path.write_text(BAD_ACCESSOR)
    assert len(refuses(r"scene\.gltf cannot be read \(TypeError: .*the file is complete", open_scene, path)) <= 300


@pytest.mark.parametrize(("extension", "name", "command", "read"), [
    ("EXT_meshopt_compression", "Meshopt", "copy", (5, 2)), ("KHR_texture_basisu", "KTX 2", "ktxdecompress", (5, 3))])
def test_a_compression_that_blender_cannot_read_is_named(tmp_path, extension, name, command, read):
    if bpy.app.version >= read:
        pytest.skip("this Blender reads it")
    path = tmp_path / "scene.gltf"
    path.write_text(json.dumps({"asset": {"version": "2.0"}, "extensionsUsed": [extension],
                                "extensionsRequired": [extension]}))
    refuses(f"compressed with {name}, .*`gltf-transform {command} scene.gltf NEW.glb`", open_scene, path)


@pytest.mark.skipif(bpy.app.version >= (5, 3, 0), reason="the bpy wheel of Blender 5.3 has no library for Draco")
@pytest.mark.parametrize("library", ["libextern_draco.so", "libbf_intern_draco_bridge.so"])
def test_draco_is_read_where_blender_has_its_library(tmp_path, monkeypatch, library):
    add_box(fresh_scene(), (0, 0, 0), (0.5, 0.5, 0.5))
    path = tmp_path / "scene.glb"
    bpy.ops.export_scene.gltf(filepath=str(path), export_draco_mesh_compression_enable=True)
    assert b"KHR_draco_mesh_compression" in path.read_bytes() and find_subject(open_scene(path))
    decoder = importlib.import_module("io_scene_gltf2.blender.imp.draco_compression_extension")
    monkeypatch.setattr(decoder, "dll_path", lambda: tmp_path / library)
    refuses("compressed with Draco, .*gltf-transform copy scene.glb", open_scene, path)


def save_cameras(path, names):
    """A glTF file with a box and cameras before it, none of them active."""
    scene = fresh_scene()
    add_box(scene, (0, 0, 0), (0.5, 0.5, 0.5))
    ours = [f"{number}{name}"[:len(name)] for number, name in enumerate(names)]  # Blender 5.3 writes them by name
    for number, name in enumerate(ours):
        add_camera(scene, (0.1 * number, -5, 0)).name = name
    bpy.ops.export_scene.gltf(filepath=str(path), export_cameras=True)
    for own, name in zip(ours, names, strict=True):
        path.write_bytes(path.read_bytes().replace(f'"{own}"'.encode(), f'"{name}"'.encode()))
    return path


def test_first_camera_of_a_gltf_file_is_used_and_others_by_name(tmp_path):
    scene = open_scene(save_cameras(tmp_path / "cameras.glb", ("zeta", "alpha")))
    assert scene.camera.name == "zeta"
    (notice,) = camera_notices(scene, None, is_imported=True)
    assert "'zeta'" in sentence(notice) and "alpha" in sentence(notice)
    assert camera_notices(scene, None, is_imported=False) == camera_notices(scene, "zeta", is_imported=True) == []
    scene.timeline_markers.new("cut", frame=1).camera = scene.camera
    choose_camera(scene, "alpha")
    scene.frame_set(1)
    assert scene.camera.name == "alpha"
    refuses(r"no camera 'alhpa': did you mean 'alpha'\? Choose one of zeta, alpha", choose_camera, scene, "alhpa")
    choose_camera(scene, "fit")
    assert scene.camera is None


def test_a_scene_without_an_active_camera_is_said(tmp_path):
    (scene := open_scene(save_cameras(tmp_path / "cameras.glb", ("zeta", "alpha")))).camera = None
    said = sentence(*camera_notices(scene, None, is_imported=True))
    assert "no active camera" in said and "--camera (zeta, alpha), or" in said and len(said) <= 300
    assert camera_notices(scene, "fit", is_imported=True) == []
    bpy.data.batch_remove([item for item in scene.objects if item.type == "CAMERA"])
    said = sentence(*camera_notices(scene, None, is_imported=False))
    assert "outer wall" in said and "--camera" not in said and "Align Active Camera to View" in said
    edit.add(scene, MINI)
    assert camera_notices(scene, None, is_imported=False) == []


def test_camera_by_name_comes_before_an_array(scene):
    camera = add_camera(scene)
    assert edit.add(scene, MINI) == rig.find(scene)
    choose_camera(scene, camera.name)
    assert rig.find(scene) is None and scene.camera == camera


@pytest.mark.parametrize("far", [3e38, float("nan"), float("inf")])
def test_vertices_beyond_numbers_are_refused(tmp_path, far):
    add_box(fresh_scene(), tuple(CENTRE), tuple(HALF)).data.vertices[0].co.x = far
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "far.blend"))
    refuses("vertices are not finite", open_scene, tmp_path / "far.blend")


@pytest.fixture
def two(scene):
    """A box in the collection Things, another in Background."""
    for name, place in (("Things", -1), ("Background", 1)):
        collection = bpy.data.collections.new(name)
        scene.collection.children.link(collection)
        item = add_box(scene, (place, 0, 0), (0.5, 0.5, 0.5), emission((1, 1, 1)))
        scene.collection.objects.unlink(item)
        collection.objects.link(item)
    return scene


def test_subject_is_what_is_not_background_and_none_that_is_visible_is_refused(two):
    things, background = (set(two.collection.children[name].objects) for name in ("Things", "Background"))
    assert contents.find_subject(two) == things == contents.find_subject(two, "Things")
    assert contents.find_subject(two, "Background") == background and contents.has_background_meshes(two, things)
    refuses("no collection 'Thing'.*Background, .*Things", contents.find_subject, two, "Thing")
    two.collection.children["Things"].objects[0].hide_render = True
    refuses("nothing of the subject 'Scene' would be rendered", contents.find_subject, two)
    two.collection.children["Things"].objects[0].hide_render = False
    two.collection.children["Things"].hide_render = True
    refuses("nothing of the subject 'Things' would be rendered", contents.find_subject, two, "Things")


def test_instanced_subject_is_marked_as_foreground(two, tmp_path):
    things = two.collection.children["Things"]
    two.collection.children.unlink(things)
    empty = bpy.data.objects.new("instance", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", things
    two.collection.objects.link(empty)
    add_camera(two, (0, -6, 0), 1.0)
    frame_folder.render_job(two, make_request(str(tmp_path), MINI, samples=1, layers=("index",)))
    assert set(np.unique(image_files.read_layers(tmp_path / "lr_eia.exr")["index"][..., 0])) == {0, 1, 2}


def test_background_meshes_are_marked_by_index(two, tmp_path):
    add_camera(two, (0, -6, 0), 1.0)
    frame_folder.render_job(two, make_request(str(tmp_path), MINI, samples=16))
    assert "index" in read_frame(tmp_path).layers, "the mask needs it as soon as there is a background mesh"
    layers = image_files.read_layers(tmp_path / "lr_eia.exr")
    alpha, index = layers["color"][..., 3], layers["index"][..., 0]
    assert set(np.unique(index)) == {0, 1, 2} and np.all(alpha[index > 0] > 0) and np.all(index[alpha == 0] == 0)
    left, right = np.array_split(index, 2, axis=1)
    assert (left == 1).sum() > 5 * (left == 2).sum() and (right == 2).sum() > 5 * (right == 1).sum()
    assert [item.pass_index for item in two.objects if item.type == "MESH"] == [0, 0]
