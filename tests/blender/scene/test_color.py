"""An image has Blender's colours, or is refused with a sentence."""

import bpy
import mathutils
import numpy as np
import pytest

from blender_addon.render.frame_folder import render_job
from blender_addon.scene.settings import color_settings
from lfsr_core.images.exr import read_layers
from tests.support.requests import make_request
from tests.support.scenes import MINI, add_box, add_camera, add_mesh, emission
from tests.support.told import refuses


@pytest.fixture
def coloured(scene):
    """A box that shines in one colour."""
    add_box(scene, (0, 0, 0), (2, 2, 2), emission((0.7, 0.2, 0.05)))
    add_camera(scene)
    return scene


def color(scene, folder, **options):
    render_job(scene, make_request(str(folder), MINI, **{"samples": 1, "scale": 4} | options))
    return read_layers(folder / "lr_eia.exr")["color"]


def refused(scene, folder, pattern, **options):
    refuses(pattern, color, scene, folder, **options)
    assert not folder.exists()


@pytest.mark.parametrize(("name", "value", "pattern"), [
    ("exposure", float("nan"), "view exposure is nan"), ("gamma", float("nan"), "view gamma is nan"),
    ("use_curve_mapping", True, "view uses curves"), ("use_white_balance", True, "view uses white balance")])
def test_views_that_the_second_stage_does_not_know_are_refused(coloured, tmp_path, name, value, pattern):
    setattr(coloured.view_settings, name, value)
    refused(coloured, tmp_path / "frame", pattern)


@pytest.mark.skipif(not hasattr(bpy.data, "colorspace"), reason="working spaces are new in Blender 5.0")
def test_another_working_space_is_refused(coloured, tmp_path):
    bpy.ops.wm.set_working_color_space(working_space="ACEScg")
    refused(coloured, tmp_path / "frame", "working space is ACEScg")


def test_a_colour_managed_file_setting_does_not_change_the_values(coloured, tmp_path):
    expected = color(coloured, tmp_path / "plain")
    settings = coloured.render.image_settings
    settings.media_type = "MULTI_LAYER_IMAGE" if hasattr(settings, "media_type") else None
    settings.file_format = "OPEN_EXR_MULTILAYER"
    settings.color_management = "OVERRIDE"
    settings.linear_colorspace_settings.name = "ACEScg"
    np.testing.assert_array_equal(color(coloured, tmp_path / "overridden"), expected)
    assert settings.color_management == "OVERRIDE"


def instanced(scene, kind):
    """Show the box ``item`` through an instancer that is returned, by its collection or from the corners of a mesh."""
    item = scene.objects["item"]
    if kind == "corners":
        instancer = add_mesh(scene, [(0, 0, 0)], [], mathutils.Matrix(), None)
        item.parent, instancer.instance_type = instancer, "VERTS"
        return instancer
    inner = bpy.data.collections.new("inner")
    inner.objects.link(item)
    scene.collection.objects.unlink(item)
    instancer = bpy.data.objects.new("instancer", None)
    instancer.instance_type, instancer.instance_collection = "COLLECTION", inner
    scene.collection.objects.link(instancer)
    return instancer


@pytest.mark.parametrize(("kind", "marked"), [
    (None, "item"), *((kind, marked) for kind in ("collection", "corners") for marked in ("item", "instancer"))])
def test_a_shadow_catcher_before_a_visible_world_is_refused(coloured, tmp_path, kind, marked):
    """Also in an instance."""
    coloured.world = bpy.data.worlds.new("sky")
    instancer = instanced(coloured, kind) if kind else None
    bpy.context.view_layer.update()
    color(coloured, tmp_path / "before", world_visible=True)
    {"item": bpy.data.objects["item"], "instancer": instancer}[marked].is_shadow_catcher = True
    bpy.context.view_layer.update()
    refused(coloured, tmp_path / "frame", "'item' is a shadow catcher", world_visible=True)
    color(coloured, tmp_path / "alone", world_visible=False)


def test_the_catchers_switch_of_a_light_is_none(coloured):
    """New lights have it on in Blender 5.2."""
    coloured.world = bpy.data.worlds.new("sky")
    light = bpy.data.objects.new("Light", bpy.data.lights.new("Light", "SUN"))
    light.is_shadow_catcher = True
    coloured.collection.objects.link(light)
    color_settings(coloured, world_visible=True)
