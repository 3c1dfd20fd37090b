"""Entries in Blender's menus: its search finds what it draws there."""

from types import SimpleNamespace

import bpy

from blender_addon.ui import menus
from tests.support.recording_layout import RecordingLayout


def drawn(draw) -> list[tuple[str, dict]]:
    layout = RecordingLayout()
    draw(SimpleNamespace(layout=layout), bpy.context)
    return layout.drawn


def entries() -> dict[str, str]:
    """Operator and text of each entry of the menu *Light Field*."""
    return {named["operator"]: named.get("text", "") for name, named in drawn(menus.LFSR_MT_render.draw)
            if name == "operator"}


def test_blenders_menus_have_the_entries(scene):
    for menu, draw in ((bpy.types.TOPBAR_MT_render, menus.draw_render),
                       (bpy.types.VIEW3D_MT_camera_add, menus.draw_camera)):
        assert draw in menu._dyn_ui_initialize()
    assert ("menu", {"menu": "LFSR_MT_render", "icon": "CAMERA_STEREO"}) in drawn(menus.draw_render)
    assert [(named["operator"], named["text"]) for _, named in drawn(menus.draw_camera)] == [
        ("lfsr.array_add", "Light Field Camera Array")]


def test_renders_start_without_blocking_blender(scene):
    assert ("set", {"operator_context": "INVOKE_DEFAULT"}) in drawn(menus.LFSR_MT_render.draw)
    assert {"lfsr.render_eia", "lfsr.render_animation", "lfsr.check_scene"} <= set(entries())


def test_an_array_is_added_once(scene):
    assert "lfsr.array_add" not in entries()
    bpy.ops.lfsr.array_remove()
    assert entries()["lfsr.array_add"] == "Light Field Camera Array"
