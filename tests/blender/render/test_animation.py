"""What the scene animates does not change how it is rendered."""

import bpy
import numpy as np
import pytest

from blender_addon.render.frame_folder import render_job
from lfsr_core.images import exr
from tests.support.requests import make_request
from tests.support.scenes import MINI, add_camera


def layers(scene, folder, **options):
    render_job(scene, make_request(str(folder), MINI, **{"samples": 2, "scale": 4, "layers": ("index",)} | options))
    return {f"{path.stem} {name}": pixels for path in folder.glob("*.exr")
            for name, pixels in exr.read_layers(path).items()}


def key(owner, path, value, frame=1):
    """A keyframe that says ``value`` at every frame."""
    before = getattr(owner, path)
    setattr(owner, path, value)
    owner.keyframe_insert(path, frame=frame)
    setattr(owner, path, before)


def marker_of_the_camera_itself(scene):
    scene.timeline_markers.new("cut", frame=1).camera = scene.camera


def keyed_samples(scene):
    key(scene.cycles, "samples", 7)
    scene.cycles.seed = 5
    key(scene.cycles, "pixel_filter_type", "GAUSSIAN")


def driven_seed(scene):
    scene.cycles.driver_add("seed").driver.expression = "frame"


def keyed_in_a_strip(scene):
    key(scene.cycles, "seed", 41)
    data = scene.animation_data
    action, slot = data.action, data.action_slot
    data.action = None
    strip = data.nla_tracks.new().strips.new("strip", 1, action)
    strip.action_slot = slot


def animated_index(scene):
    box = bpy.data.objects["box"]
    key(box, "pass_index", 2)
    bpy.data.objects["item"].driver_add("pass_index").driver.expression = "1"


@pytest.mark.parametrize(("animate", "layout"), [
    ((marker_of_the_camera_itself, keyed_samples, driven_seed, animated_index), "one-pass"),
    ((keyed_samples, animated_index), "view-by-view"), ((keyed_in_a_strip,), "one-pass")])
def test_animated_settings_change_nothing(lit, tmp_path, animate, layout):
    expected = layers(lit, tmp_path / "plain", layout=layout, seed=3)
    for each in animate:
        each(lit)
    found = layers(lit, tmp_path / "animated", layout=layout, seed=3)
    assert found.keys() == expected.keys()
    for name, pixels in expected.items():
        np.testing.assert_array_equal(found[name], pixels, err_msg=name)


def test_the_array_stands_where_a_marker_puts_the_camera_and_stays_an_array(lit, tmp_path):
    first, other = lit.camera, add_camera(lit, (0.2, -4, 0.1), 0.6)
    expected = layers(lit, tmp_path / "plain")
    lit.camera = first
    lit.timeline_markers.new("cut", frame=1).camera = other
    found = layers(lit, tmp_path / "marked", frame=1)
    np.testing.assert_array_equal(found["lr_eia color"], expected["lr_eia color"])
    assert lit.timeline_markers["cut"].camera == other


def test_a_driven_seed_leaves_the_halves_of_a_reference_apart_and_all_moves_again(lit, tmp_path):
    driven_seed(lit)
    keyed_samples(lit)
    halves = layers(lit, tmp_path / "reference", kind="reference", scale=1, layers=())
    assert not np.array_equal(halves["reference_a color"], halves["reference_b color"])
    assert not any(curve.mute for curve in lit.animation_data.drivers)
    lit.frame_set(9)
    assert (lit.cycles.seed, lit.cycles.samples) == (9, 7)
