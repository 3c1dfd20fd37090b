"""What differs between Blender 4.5, 5.0 and 5.2; nothing else asks for the version."""

from __future__ import annotations

from typing import Any

import bpy


def multilayer_exr(half: bool = False) -> dict[str, Any]:
    """Image settings for a multi-layer EXR of 32-bit (or 16-bit) floats, in the order they must be set."""
    common = {"file_format": "OPEN_EXR_MULTILAYER", "color_mode": "RGBA", "color_depth": "16" if half else "32",
              "exr_codec": "ZIP", "color_management": "FOLLOW_SCENE"}
    if "media_type" in bpy.types.ImageFormatSettings.bl_rna.properties:
        return {"media_type": "MULTI_LAYER_IMAGE"} | common
    return common


def one_part_exr() -> dict[str, Any]:
    """Image settings for all passes in one part of the file, as before 5.0, whose several parts end in an error where
    pixels are not square."""
    has_parts = "use_exr_interleave" in bpy.types.ImageFormatSettings.bl_rna.properties
    return {"use_exr_interleave": True} if has_parts else {}


def video_output() -> dict[str, Any]:
    """Image settings for a film, in the order they must be set."""
    video = {"file_format": "FFMPEG", "color_mode": "RGB"}
    has_media = "media_type" in bpy.types.ImageFormatSettings.bl_rna.properties
    return {"media_type": "VIDEO"} | video if has_media else video


def working_space() -> str:
    """Name of the file's linear colour space, which can be chosen since 5.0."""
    return bpy.data.colorspace.working_space if hasattr(bpy.data, "colorspace") else "Linear Rec.709"


def literal_path(path: str) -> str:
    """``path`` for a render's output: since 5.0 braces there are templates unless they are doubled."""
    return path.replace("{", "{{").replace("}", "}}") if bpy.app.version >= (5, 0, 0) else path


def use_nodes(owner: bpy.types.Material | bpy.types.World) -> None:
    """Give a new material or world its node tree; since 5.0 it has one from the start."""
    if owner.node_tree is None:
        owner.use_nodes = True


def whole_sample_range() -> dict[str, Any]:
    """Cycles settings that render all samples, where a range of them can be chosen."""
    return {"use_sample_subset": False} if hasattr(bpy.context.scene.cycles, "use_sample_subset") else {}


def whole_textures() -> dict[str, Any]:
    """Render settings that read textures whole: 5.2's cache takes a lens for far away and blurs what it sees."""
    known = "use_texture_cache" in bpy.types.RenderSettings.bl_rna.properties
    return {"use_texture_cache": False} if known else {}
