"""Differences between Blender 4.5, 5.0 and 5.2; no other module asks for the version."""

from __future__ import annotations

from typing import Any

import bpy


def _has(owner: Any, name: str) -> bool:
    """True if this Blender's type ``owner`` has the property ``name``."""
    return name in owner.bl_rna.properties


def _media(kind: str) -> dict[str, Any]:
    """Kind of media that must be set before a file format, since 5.0."""
    return {"media_type": kind} if _has(bpy.types.ImageFormatSettings, "media_type") else {}


def multilayer_exr(half: bool = False) -> dict[str, Any]:
    """Return image settings for a multi-layer EXR of 32-bit (or 16-bit) floats, in the order they must be set."""
    return _media("MULTI_LAYER_IMAGE") | {
        "file_format": "OPEN_EXR_MULTILAYER", "color_mode": "RGBA", "color_depth": "16" if half else "32",
        "exr_codec": "ZIP", "color_management": "FOLLOW_SCENE"}


def one_part_exr() -> dict[str, Any]:
    """Return image settings that write all passes into one part; several parts fail where pixels are not square."""
    return {"use_exr_interleave": True} if _has(bpy.types.ImageFormatSettings, "use_exr_interleave") else {}


def video_output() -> dict[str, Any]:
    """Return image settings for a film, in the order they must be set."""
    return _media("VIDEO") | {"file_format": "FFMPEG", "color_mode": "RGB"}


def working_space() -> str:
    """Return the name of the file's linear colour space, which can be chosen since 5.0."""
    return bpy.data.colorspace.working_space if hasattr(bpy.data, "colorspace") else "Linear Rec.709"


def compositor(scene: bpy.types.Scene) -> bpy.types.NodeTree | None:
    """Return the nodes that Blender would apply to a render of ``scene``; since 5.0 they are a node group."""
    if not scene.render.use_compositing:
        return None
    if _has(bpy.types.Scene, "compositing_node_group"):
        return scene.compositing_node_group
    return scene.node_tree if scene.use_nodes else None


def literal_path(path: str) -> str:
    """Return ``path`` for a render's output: since 5.0 single braces there are templates."""
    return path.replace("{", "{{").replace("}", "}}") if bpy.app.version >= (5, 0, 0) else path


def use_nodes(owner: bpy.types.Material | bpy.types.World) -> None:
    """Give a new material or world its node tree; since 5.0 it has one from the start."""
    if owner.node_tree is None:
        owner.use_nodes = True


def whole_sample_range() -> dict[str, Any]:
    """Return Cycles settings that render all samples, in versions that can render a range of them."""
    return {"use_sample_subset": False} if hasattr(bpy.context.scene.cycles, "use_sample_subset") else {}


def no_overrides() -> dict[str, Any]:
    """Return view layer settings without overrides of materials and, where this Blender has it, of the world."""
    return {name: None for name in ("material_override", "world_override") if _has(bpy.types.ViewLayer, name)}


def whole_textures() -> dict[str, Any]:
    """Return render settings without 5.2's texture cache, which blurs what is seen through a lens."""
    return {"use_texture_cache": False} if _has(bpy.types.RenderSettings, "use_texture_cache") else {}
