"""Which objects are the subject, and how renders mark them."""

import bpy
import numpy as np
import pytest

from blender_addon.render import frame_folder
from blender_addon.scene import subject
from lfsr_core.frames.frame import read_frame
from lfsr_core.images import exr
from tests.support.requests import make_request
from tests.support.scenes import MINI, add_box, add_camera, emission
from tests.support.told import refuses


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


def test_subject_is_what_is_not_background(two):
    things, background = (set(two.collection.children[name].objects) for name in ("Things", "Background"))
    assert subject.find_subject(two) == things == subject.find_subject(two, "Things")
    assert subject.find_subject(two, "Background") == background
    assert subject.has_background_meshes(two, things)


def test_no_visible_subject_is_refused(two):
    refuses("no collection 'Thing'.*Background, .*Things", subject.find_subject, two, "Thing")
    two.collection.children["Things"].objects[0].hide_render = True
    refuses("nothing of the subject 'Scene' would be rendered", subject.find_subject, two)
    two.collection.children["Things"].objects[0].hide_render = False
    two.collection.children["Things"].hide_render = True
    refuses("nothing of the subject 'Things' would be rendered", subject.find_subject, two, "Things")


def test_instanced_subject_is_marked_as_foreground(two, tmp_path):
    things = two.collection.children["Things"]
    two.collection.children.unlink(things)
    empty = bpy.data.objects.new("instance", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", things
    two.collection.objects.link(empty)
    add_camera(two, (0, -6, 0), 1.0)
    frame_folder.render_job(two, make_request(str(tmp_path), MINI, samples=1, layers=("index",)))
    index = exr.read_layers(tmp_path / "lr_eia.exr")["index"][..., 0]
    assert set(np.unique(index)) == {0, 1, 2}


def test_background_meshes_are_marked_by_index(two, tmp_path):
    add_camera(two, (0, -6, 0), 1.0)
    frame_folder.render_job(two, make_request(str(tmp_path), MINI, samples=16))
    frame = read_frame(tmp_path)
    assert "index" in frame.layers, "the mask needs it as soon as there is a background mesh"
    layers = exr.read_layers(tmp_path / "lr_eia.exr")
    alpha, index = layers["color"][..., 3], layers["index"][..., 0]
    assert set(np.unique(index)) == {0, 1, 2}
    assert np.all(alpha[index > 0] > 0) and np.all(index[alpha == 0] == 0)
    left, right = np.array_split(index, 2, axis=1)
    assert (left == 1).sum() > 5 * (left == 2).sum() and (right == 2).sum() > 5 * (right == 1).sum()
    assert [item.pass_index for item in two.objects if item.type == "MESH"] == [0, 0]
