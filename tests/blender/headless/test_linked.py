"""Linked data: whatever of a scene is linked from a library, it renders as if it were not."""

import dataclasses
from pathlib import Path

import bpy
import numpy as np
import pytest

from blender_addon.jobs import folders
from blender_addon.jobs.session import Task
from blender_addon.ui.operators.render import image_job
from lfsr_core.frames.frame import read_frame
from lfsr_core.images.image_files import read_layers
from tests.support import panel
from tests.support.scenes import add_box, link

COLLECTIONS, OBJECTS = ["Props", "Background"], ["Box", "Wall"]


def set_up() -> bpy.types.Scene:
    """A red box, a wall in the collection Background, and a blue world."""
    scene = panel.artist_scene(None)
    wall, box = add_box(scene, (0, 2, 0), (4, 0.1, 4)), bpy.data.objects["Box"]
    wall.name = "Wall"
    for name, item in zip(COLLECTIONS, (box, wall), strict=True):
        collection = bpy.data.collections.new(name)
        scene.collection.children.link(collection)
        collection.objects.link(item)
        scene.collection.objects.unlink(item)
    scene.world = bpy.data.worlds.new("Blue")
    scene.world.color = (0.2, 0.3, 0.5)
    material = bpy.data.materials.new("Red")
    material.diffuse_color = (0.8, 0.1, 0.1, 1)
    box.data.materials.append(material)
    return scene


def render(layout: str) -> tuple[Path, dict[str, np.ndarray]]:
    """Frame folder and layers of the open scene, rendered as by the button."""
    job = image_job(bpy.context.scene)
    request = dataclasses.replace(job.arguments["request"], layout=layout)
    Task("Render EIA", dataclasses.replace(job, arguments={**job.arguments, "request": request})).run()
    folder = Path(request.output)
    return folder, read_layers(folder / "lr_eia.exr")


pytestmark = pytest.mark.usefixtures("add_on")


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("library") / "set.blend"
    set_up()
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


@pytest.fixture(scope="module")
def unlinked(library) -> dict[str, dict[str, np.ndarray]]:
    """Layers of the library's own scene, by layout."""
    bpy.ops.wm.open_mainfile(filepath=str(library))
    return {layout: render(layout)[1] for layout in ("one-pass", "lens-card")}


def linked_collections(library: Path) -> tuple[bpy.types.Scene, list[bpy.types.Collection]]:
    scene = set_up()
    bpy.data.batch_remove([*(bpy.data.objects[name] for name in OBJECTS),
                           *(bpy.data.collections[name] for name in COLLECTIONS)])
    for collection in (collections := link(library, "collections", COLLECTIONS)):
        scene.collection.children.link(collection)
    return scene, collections


def linked_objects(library: Path) -> None:
    scene = set_up()
    bpy.data.batch_remove([bpy.data.objects[name] for name in OBJECTS])
    for name, item in zip(COLLECTIONS, link(library, "objects", OBJECTS), strict=True):
        scene.collection.children[name].objects.link(item)


def an_instance(library: Path) -> None:
    scene, (props, _) = linked_collections(library)
    scene.collection.children.unlink(props)
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", props
    scene.collection.objects.link(instance)


def an_override(library: Path) -> None:
    scene, collections = linked_collections(library)
    for collection in collections:  # in the scene, as Blender 5.3 needs it
        collection.override_hierarchy_create(scene, bpy.context.view_layer)
        scene.collection.children.unlink(collection)
    assert all(item.override_library for item in bpy.data.objects if item.library is None and item.name in OBJECTS)


def a_scene(library: Path) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert bpy.context.scene.name == "Scene", "a local scene of the same name"
    (bpy.context.window.scene,) = link(library, "scenes", ["Scene"])
    for item in bpy.context.scene.objects:
        item.update_tag()  # else Blender 4.5 leaves them at the origin until the file is opened again


@pytest.mark.parametrize(("way", "layout"), [
    *((way, "one-pass") for way in (linked_collections, linked_objects, an_instance, an_override, a_scene)),
    (a_scene, "lens-card")])
def test_linked_data_renders_as_if_it_were_local(library, unlinked, tmp_path, way, layout):
    way(library)
    bpy.context.scene.lfsr.output = str(tmp_path)  # not saved in the library
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    assert bpy.data.libraries
    if way is a_scene:
        bpy.context.scene.lfsr.output = "//lightfield/"
    folder, layers = render(layout)
    assert layers.keys() == unlinked[layout].keys() >= {"color", "index"}
    for name, pixels in unlinked[layout].items():
        np.testing.assert_array_equal(layers[name], pixels, err_msg=name)
    assert set(np.unique(layers["index"])) >= {1, 2}
    if way is a_scene:
        assert folder == tmp_path / "lightfield" / "shot" / "Scene_set.blend_" / "0001"
        assert read_frame(folder).scene_name == "Scene [set.blend]", "which is not the local one's folder"
        assert folders.frame_folder(bpy.data.scenes["Scene", None]).parent.name == "Scene"
