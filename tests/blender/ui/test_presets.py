"""Quality presets and Blender presets."""

from __future__ import annotations

import zlib
from pathlib import Path

import bpy
import pytest

from blender_addon.settings import methods, scene_settings
from blender_addon.ui import presets
from tests.support import panel


@pytest.fixture
def scene(tmp_path):
    with panel.registered():
        yield panel.artist_scene(tmp_path)


@pytest.mark.parametrize("name", scene_settings.QUALITY)
def test_quality_sets_samples_and_method(scene, name):
    scene.lfsr.quality = name
    assert (scene.lfsr.samples, scene.lfsr.method) == scene_settings.QUALITY[name]
    assert scene.lfsr.quality == name


def test_changing_a_value_is_custom_and_back(scene):
    scene.lfsr.quality = "FINAL"
    samples = scene.lfsr.samples
    scene.lfsr.samples = samples + 1
    assert scene.lfsr.quality == "CUSTOM"
    scene.lfsr.samples = samples
    assert scene.lfsr.quality == "FINAL"


def test_more_quality_is_more_rays():
    samples = [scene_settings.QUALITY[name][0] for name in ("DRAFT", "BALANCED", "FINAL")]
    assert samples == sorted(samples) and len(set(samples)) == 3


def test_a_blender_preset_is_saved_loaded_and_removed(scene):
    scene.lfsr.display, scene.lfsr.scale, scene.lfsr.samples, scene.lfsr.method = "small", "5", 21, "lanczos"
    assert bpy.ops.lfsr.preset_add(name="My Wall") == {"FINISHED"}
    folder = Path(bpy.utils.user_resource("SCRIPTS", path=f"presets/{presets.SUBFOLDER}"))
    file = folder / "My_Wall.py"
    assert file.is_file()
    scene.lfsr.display, scene.lfsr.scale, scene.lfsr.samples, scene.lfsr.method = "mini", "2", 1, "bicubic"
    bpy.ops.script.execute_preset(filepath=str(file), menu_idname="LFSR_PT_presets")
    lfsr = scene.lfsr
    assert (lfsr.display, lfsr.scale, lfsr.samples, lfsr.method) == ("small", "5", 21, "lanczos")
    assert scene.lfsr.quality == "CUSTOM"
    presets.LFSR_PT_presets.bl_label = "My Wall"
    assert bpy.ops.lfsr.preset_add(name="My Wall", remove_active=True) == {"FINISHED"}
    presets.LFSR_PT_presets.bl_label = "Light Field Presets"
    assert not file.exists()


def test_saved_settings_all_exist(scene):
    assert set(presets.SAVED) <= {item.identifier for item in scene.lfsr.bl_rna.properties}


def test_methods_name_their_layers_and_have_lasting_numbers():
    items = methods.method_items()
    assert len({item[4] for item in items}) == len(items)
    # The number stored in artists' files: a new method must not shift it.
    assert {item[0]: item[4] for item in items}["oidn+bicubic"] == zlib.crc32(b"oidn+bicubic") & 0x7FFFFFFF
    from lfsr_core.reconstruct.method_name import MethodName

    assert MethodName.parse("oidn-guided+bicubic").layers == MethodName.parse("light").layers == ("albedo", "normal")
    assert MethodName.parse("oidn+bicubic").layers == MethodName.parse("bicubic").layers == ()


def test_every_method_of_the_menu_is_one_of_the_second_stage():
    from lfsr_core.reconstruct.method_name import MethodName

    for name, *_ in methods.method_items():
        assert MethodName.parse(name).text == name
