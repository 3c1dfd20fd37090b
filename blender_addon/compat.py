"""What differs between Blender 3.4, 4.5, 5.0 and 5.2; nothing else asks for the version."""

from __future__ import annotations

from typing import Any

import bpy


def multilayer_exr(half: bool = False) -> dict[str, Any]:
    """Image settings for a multi-layer EXR of 32-bit (or 16-bit) floats, in the order they must be set."""
    common = {"file_format": "OPEN_EXR_MULTILAYER", "color_mode": "RGBA", "color_depth": "16" if half else "32",
              "exr_codec": "ZIP"}
    if "media_type" in bpy.types.ImageFormatSettings.bl_rna.properties:
        return {"media_type": "MULTI_LAYER_IMAGE"} | common
    return common


def use_nodes(owner: bpy.types.Material | bpy.types.World) -> None:
    """Give a new material or world its node tree; since 5.0 it has one from the start."""
    if owner.node_tree is None:
        owner.use_nodes = True


def has_custom_camera() -> bool:
    """True if Cycles can send rays by an OSL shader: Blender 4.5 and newer."""
    return "CUSTOM" in bpy.types.Camera.bl_rna.properties["type"].enum_items


def shader_name(name: str) -> str:
    """Name of the gpu module's built-in shader for points in three dimensions."""
    return name if bpy.app.version >= (4, 0, 0) else f"3D_{name}"


def is_editable(data: bpy.types.ID) -> bool:
    """True if properties of ``data`` can be set: it is not linked from another file."""
    return getattr(data, "is_editable", data.library is None)


def whole_sample_range() -> dict[str, Any]:
    """Cycles settings that render all samples, where a range of them can be chosen."""
    return {"use_sample_subset": False} if hasattr(bpy.context.scene.cycles, "use_sample_subset") else {}


def relative_path() -> set[str]:
    """Options of a path property that may begin with //, the folder of the .blend file."""
    return {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5, 0) else set()
