"""Entries in Blender's own menus, where its search (F3) finds them by name."""

from __future__ import annotations

import bpy

from ..scene.array import cached


class LFSR_MT_render(bpy.types.Menu):
    """Light-field renders of this scene"""

    bl_label = "Light Field"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw what the panel's buttons do, in the order of the work."""
        layout = self.layout
        layout.operator_context = "INVOKE_DEFAULT"  # elsewhere a render would block Blender until its end
        layout.operator("lfsr.render_eia", icon="RENDER_STILL")
        layout.operator("lfsr.render_animation", text="Render EIA Animation", icon="RENDER_ANIMATION")
        layout.separator()
        if cached.find(context.scene) is None:
            _draw_add(layout)
        layout.operator("lfsr.array_fit", text="Fit Camera Array to Selection")
        layout.operator("lfsr.check_scene")
        layout.separator()
        layout.operator("lfsr.preview_view")
        layout.operator("lfsr.open_viewer")
        layout.operator("lfsr.show")


def _draw_add(layout: bpy.types.UILayout) -> None:
    layout.operator("lfsr.array_add", text="Light Field Camera Array", icon="OUTLINER_OB_CAMERA")


def draw_render(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """End of the menu *Render*."""
    menu.layout.separator()
    menu.layout.menu("LFSR_MT_render", icon="CAMERA_STEREO")


def draw_camera(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """End of the menu *Add > Camera*."""
    _draw_add(menu.layout)


CLASSES = (LFSR_MT_render,)


def register() -> None:
    """Append the entries."""
    bpy.types.TOPBAR_MT_render.append(draw_render)
    bpy.types.VIEW3D_MT_camera_add.append(draw_camera)


def unregister() -> None:
    """Remove them again."""
    bpy.types.VIEW3D_MT_camera_add.remove(draw_camera)
    bpy.types.TOPBAR_MT_render.remove(draw_render)
