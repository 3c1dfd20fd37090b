"""Blender presets: saved, loaded and removed."""

from pathlib import Path

import bpy

from blender_addon.ui import menus


def test_a_blender_preset_is_saved_loaded_and_removed(scene):
    scene.lfsr.display, scene.lfsr.scale, scene.lfsr.samples, scene.lfsr.method = "small", "5", 21, "lanczos"
    scene.lfsr.rays = 2.5
    assert bpy.ops.lfsr.preset_add(name="My Wall") == {"FINISHED"}
    folder = Path(bpy.utils.user_resource("SCRIPTS", path=f"presets/{menus.SUBFOLDER}"))
    file = folder / "My_Wall.py"
    assert file.is_file()
    scene.lfsr.display, scene.lfsr.scale, scene.lfsr.samples, scene.lfsr.method = "mini", "2", 1, "bicubic"
    scene.lfsr.rays = 1
    bpy.ops.script.execute_preset(filepath=str(file), menu_idname="LFSR_PT_presets")
    lfsr = scene.lfsr
    assert (lfsr.display, lfsr.scale, lfsr.samples, lfsr.method) == ("small", "5", 21, "lanczos")
    assert (scene.lfsr.quality, scene.lfsr.rays) == ("CUSTOM", 2.5)
    menus.LFSR_PT_presets.bl_label = "My Wall"
    assert bpy.ops.lfsr.preset_add(name="My Wall", remove_active=True) == {"FINISHED"}
    menus.LFSR_PT_presets.bl_label = "Light Field Presets"
    assert not file.exists()


def test_saved_settings_all_exist(scene):
    assert set(menus.SAVED) <= {item.identifier for item in scene.lfsr.bl_rna.properties}
