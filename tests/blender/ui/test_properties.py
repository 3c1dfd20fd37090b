"""Quality presets set rays and method, and follow them; fixed samples stay as they are."""

from pathlib import Path

import bpy
import pytest

from blender_addon.scene import settings as scene_settings
from blender_addon.ui import panels, properties
from lfsr_core.optics.display import builtin_names
from lfsr_core.plan.options import default_methods
from lfsr_core.reconstruct.methods import DEFAULT_METHOD, MethodName


@pytest.mark.parametrize("name", scene_settings.QUALITY_SAMPLES)
def test_quality_sets_rays_and_method(scene, name):
    scene.lfsr.quality, scene.lfsr.scale = name, "4"
    assert (scene.lfsr.samples, scene.lfsr.method) == (0, DEFAULT_METHOD)
    assert scene_settings.resolve(scene).sampling.samples == scene_settings.QUALITY_SAMPLES[name]
    assert scene.lfsr.quality == name


@pytest.mark.parametrize("changed", ["rays", "samples"])
def test_changing_a_value_is_custom_and_back(scene, changed):
    scene.lfsr.quality = "FINAL"
    before = getattr(scene.lfsr, changed)
    setattr(scene.lfsr, changed, before + 1)
    assert scene.lfsr.quality == "CUSTOM"
    setattr(scene.lfsr, changed, before)
    assert scene.lfsr.quality == "FINAL"


def test_samples_that_were_set_stay_at_every_scale_and_so_do_the_rays(scene):
    scene.lfsr.samples = 40
    for scale in ("2", "4", scene_settings.AUTO_SCALE):
        scene.lfsr.scale = scale
        resolved = scene_settings.resolve(scene)
        assert (resolved.sampling.samples, resolved.rays, resolved.request.samples_at(1)) == (40, None, 40)
    scene.lfsr.samples, scene.lfsr.rays = 0, 2.0
    samples = {}
    for scale in ("1", "2", "4", "8"):
        scene.lfsr.scale = scale
        samples[scale] = scene_settings.resolve(scene).sampling.samples
    assert samples == {"1": 2, "2": 8, "4": 32, "8": 128}


def test_a_preset_costs_the_same_on_every_display_and_the_menu_has_every_method_of_a_plan(scene):
    scene.lfsr.quality = "BALANCED"
    for display, rays in (("small", 1), ("looking-glass-16", 4)):
        scene.lfsr.display = display
        assert (scene.lfsr.quality, scene.lfsr.rays) == ("BALANCED", rays)
    scene.lfsr.subpixels = True
    assert (scene.lfsr.rays, scene_settings.resolve(scene).sampling.samples) == (16, 16)
    items = properties.method_items()
    listed = {item[0] for item in items}
    assert len({item[4] for item in items}) == len(items), "each has a number of its own"
    assert all(not name or MethodName.parse(name).text == name for name in listed)
    assert {MethodName.parse(name).at_scale(scale).text for name in default_methods() for scale in (1, 4)} <= listed


@pytest.mark.parametrize("name", builtin_names())
def test_only_scales_that_divide_the_views_are_offered(scene, name):
    scene.lfsr.display = name
    offered = scene_settings.offered_scales(scene)
    assert offered[:2] == ["AUTO", "1"] and len(offered) > 2
    for scale in offered[1:]:
        scene_settings.display_of(scene).low_views(int(scale))


def test_a_scale_that_another_display_lacks_becomes_auto_and_saved_settings_all_exist(scene):
    scene.lfsr.display, scene.lfsr.scale = "bupt-32in-8k", "5"
    scene.lfsr.display = "dense-8k"
    assert scene.lfsr.scale == "5"
    scene.lfsr.display = "mini"
    assert scene.lfsr.scale == "AUTO"
    assert set(panels.SAVED) <= {item.identifier for item in scene.lfsr.bl_rna.properties}
    assert all(item.identifier.startswith("live_") for item in scene.lfsr.bl_rna.properties if item.is_animatable)


def test_a_blender_preset_is_saved_loaded_and_removed(scene):
    scene.lfsr.display, scene.lfsr.scale, scene.lfsr.samples, scene.lfsr.method = "small", "5", 21, "bicubic"
    scene.lfsr.rays = 2.5
    assert bpy.ops.lfsr.preset_add(name="My Wall") == {"FINISHED"}
    file = Path(bpy.utils.user_resource("SCRIPTS", path=f"presets/{panels.SUBFOLDER}")) / "My_Wall.py"
    assert file.is_file()
    scene.lfsr.display, scene.lfsr.scale, scene.lfsr.samples, scene.lfsr.method = "mini", "2", 1, "bicubic"
    scene.lfsr.rays = 1
    bpy.ops.script.execute_preset(filepath=str(file), menu_idname="LFSR_PT_presets")
    lfsr = scene.lfsr
    assert (lfsr.display, lfsr.scale, lfsr.samples, lfsr.method) == ("small", "5", 21, "bicubic")
    assert (scene.lfsr.quality, scene.lfsr.rays) == ("CUSTOM", 2.5)
    panels.LFSR_PT_presets.bl_label = "My Wall"
    assert bpy.ops.lfsr.preset_add(name="My Wall", remove_active=True) == {"FINISHED"}
    panels.LFSR_PT_presets.bl_label = "Light Field Presets"
    assert not file.exists()
