"""What differs between Blender 4.5, 5.0 and 5.2; nothing else asks for the version."""

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
